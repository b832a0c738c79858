"""Emotions along time, from windows of a sound."""

from collections.abc import Sequence

import numpy as np

from .arrays import Floats
from .errors import FacesynthError
from .filters import gaussian
from .motion import Motion
from .speech import EmotionTrack

CHANGES_S = 0.08
"""Standard deviation of the smoothing with which emotions come and go."""
WINDOW_S, HOP_S = 2.0, 0.5
"""Length of what is listened to at once, and its step."""
NOBODY_SPEAKS = "the sound is constant (silence?); choose a recording in which somebody speaks"


def check_windows(window_s: float, hop_s: float) -> None:
    """FacesynthError where windows of such a length and step cannot cover a sound."""
    if not 0 < hop_s <= window_s:
        raise FacesynthError(f"windows of {window_s} s every {hop_s} s; wanted both positive and no step longer than a window")


def window_starts(duration_s: float, window_s: float, hop_s: float) -> Floats:
    """[N] start of each window in seconds; the last one ends with the sound."""
    count = max(1, int(np.ceil((duration_s - window_s) / hop_s)) + 1)
    return np.minimum(np.arange(count) * hop_s, max(0.0, duration_s - window_s))


def mean_of_windows(
    heard: Sequence[tuple[float, Floats]], window_s: float, hop_s: float, duration_s: float
) -> tuple[Floats, Floats]:
    """Ends [H] (s) of steps and probabilities [H, K] there, from the starts (s) and probabilities [K] of windows."""
    if not heard:
        raise FacesynthError(NOBODY_SPEAKS)
    centres_s, probabilities = np.array([start for start, _ in heard]) + window_s / 2, np.array([p for _, p in heard])
    ends_s = np.append(np.arange(hop_s, duration_s - hop_s / 2, hop_s), duration_s)
    apart_s = np.abs(centres_s - (ends_s - hop_s / 2)[:, None])  # [H, windows]
    covering = (apart_s <= window_s / 2) | (apart_s == apart_s.min(axis=1, keepdims=True))
    return ends_s, covering @ probabilities / covering.sum(axis=1, keepdims=True)


def track_of(ends_s: Floats, probabilities: Floats, emotions: Sequence[str]) -> EmotionTrack:
    """The most probable emotion of each step, those of one emotion in a row as one interval."""
    best = probabilities.argmax(axis=1)
    last = np.append(np.flatnonzero(np.diff(best)), len(best) - 1)
    return EmotionTrack(tuple(emotions[k] for k in best[last]), ends_s[last], np.ones(len(last)))


def felt_over(track: EmotionTrack, emotion: str, motion: Motion, amount: Floats | float = 1.0) -> Floats:
    """[T] amount (of each interval of the emotion track) where the emotion is felt, 0 elsewhere; smooth over time."""
    felt = np.array([label == emotion for label in track.labels]) * amount
    return gaussian(felt[track.index_at(motion.times_s)], CHANGES_S * motion.fps)
