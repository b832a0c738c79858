"""What an emotion adds to a neutral recording of the same sentence, moment by moment."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus import Utterance
from facesynth.inference.arrays import Floats
from facesynth.inference.layout import Layout
from facesynth.inference.phones import SILENCE
from facesynth.inference.speech import NEUTRAL, PhoneTrack

APART_S = 1e-6
"""Two moments of one recording that are one in the other are so far apart, s."""


@dataclass(frozen=True, eq=False)
class Difference:
    """One sentence's expressive motion without its speech."""

    emotion: str
    sentence: str
    phones: PhoneTrack
    """Of the neutral recording."""
    frames: Floats
    """[T, C] at the neutral recording's timing; NaN where either has a gap."""


def twins(utterances: Iterable[Utterance]) -> Iterator[tuple[Utterance, Utterance]]:
    """Neutral recordings with those of the same sentence in an emotion: first take with first take, and so on."""
    ordered = sorted(utterances, key=lambda u: (u.sentence, u.emotion, u.take))
    neutral: dict[str, list[Utterance]] = {}
    felt: dict[tuple[str, str], list[Utterance]] = {}
    for one in ordered:
        if one.emotion == NEUTRAL:
            neutral.setdefault(one.sentence, []).append(one)
        else:
            felt.setdefault((one.sentence, one.emotion), []).append(one)
    for (sentence, _), takes in felt.items():
        yield from zip(neutral.get(sentence, ()), takes, strict=False)


def says_the_same(a: PhoneTrack, b: PhoneTrack) -> bool:
    """Whether two recordings have the same phones; pauses may differ."""
    return [p for p in a.labels if p != SILENCE] == [p for p in b.labels if p != SILENCE]


# Phone by phone: the k-th spoken phone of one recording lies where the k-th of the other does, and time is linear between their
# ends. A pause that only one of them makes has no length in the other; its two ends are held a moment apart there.
def times_in(other: PhoneTrack, own: PhoneTrack, times_s: Floats) -> Floats:
    """Where the same is said in another recording as at times [T] of one's own."""
    knots, there = (_knots(track) for track in (own, other))
    knots = np.maximum.accumulate(knots + APART_S * np.arange(len(knots)))
    return np.interp(times_s, knots, there)


def difference_of(neutral: Utterance, felt: Utterance) -> Difference:
    """Warp the expressive recording to the neutral timing, subtract, and leave the eyelids out: they blink on their own."""
    own, other = neutral.motion, felt.motion
    at = np.clip(times_in(felt.speech.phones, neutral.speech.phones, own.times_s) * other.fps, 0, len(other) - 1)
    low = np.minimum(at.astype(np.int64), max(len(other) - 2, 0))
    share = (at - low)[:, None]
    there = other.frames.astype(np.float64)
    warped = there[low] * (1 - share) + there[np.minimum(low + 1, len(other) - 1)] * share
    frames = warped - own.frames
    frames[:, lid_columns(own.layout)] = np.where(np.isfinite(frames).all(axis=1), 0.0, np.nan)[:, None]
    return Difference(felt.emotion, felt.sentence, neutral.speech.phones, frames)


def lid_columns(layout: Layout) -> NDArray[np.int64]:
    """Channels of the eyelids, where the layout names them."""
    return layout.columns("eyelids") if "eyelids" in layout.groups else np.zeros(0, np.int64)


def whole_runs(frames: Floats) -> list[Floats]:
    """Stretches [L, C] of frames [T, C] without gaps."""
    whole = np.flatnonzero(np.isfinite(frames).all(axis=1))
    runs = np.split(whole, np.flatnonzero(np.diff(whole) > 1) + 1)
    return [frames[run] for run in runs if len(run) > 1]


def _knots(track: PhoneTrack) -> Floats:
    """0, the start and the end of every spoken phone, and the end of all, s."""
    spoken = np.array([label != SILENCE for label in track.labels])
    ends = np.stack([track.starts_s[spoken], track.ends_s[spoken]], axis=1).ravel()
    return np.concatenate([[0.0], ends, [track.duration_s]])
