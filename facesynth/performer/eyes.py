"""Blinks and gaze: the eyes keep to the listener while the head moves, look away now and then, and shut for a moment."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from facesynth.performer.emotion import Feelings
from facesynth.performer.wander import wander

SHUT_S, STAY_S, OPEN_S = 0.07, 0.03, 0.16
"""A blink: down, closed, up again."""
BETWEEN_BLINKS_S = (1.6, 4.2)
BLINK_EVERY: Mapping[str, float] = {"neutral": 1.0, "happy": 1.0, "angry": 1.4, "sad": 1.2}
"""Factor of the time between blinks."""
FIXATION_S = (0.5, 1.8)
AWAY = 0.65
"""Share of fixations beside the listener's eyes."""
AWAY_DEG = (2.4, 1.3)
"""Standard deviation of such a look, sideways and up."""
COMPENSATION = 0.6
"""Share of the head's turn that the eyes undo."""
SAD_GAZE_DEG = -4.0


@dataclass(frozen=True, eq=False)
class Eyes:
    """What the eyes do over T frames."""

    blink: NDArray[np.float64]
    """[T] 0 open to 1 shut, by blinking alone."""
    gaze_rad: NDArray[np.float64]
    """[T, 2] relative to the head: to the performer's left, up."""


def look(feelings: Feelings, head: NDArray[np.float64], fps: float, rng: np.random.Generator) -> Eyes:
    """Eyes for a head [T, 6] that moves."""
    count = len(head)
    gaze_deg = _saccades(count, fps, rng)
    gaze_deg[:, 1] += SAD_GAZE_DEG * np.clip(feelings.share("sad"), 0.0, 1.2)
    gaze_deg += 0.15 * np.stack([wander(count, fps, 2.0, rng), wander(count, fps, 2.0, rng)], axis=1)
    down, left = head[:, 0], head[:, 1]
    gaze = np.radians(gaze_deg) + COMPENSATION * np.stack([-left, down], axis=1)
    return Eyes(_blinks(feelings, count, fps, rng), gaze)


def _saccades(count: int, fps: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """[T, 2] degrees: fixations, joined by jumps of some 30 ms."""
    gaze = np.zeros((count, 2))
    time_s = 0.0
    while time_s < count / fps:
        gaze[round(time_s * fps) :] = rng.normal(0.0, AWAY_DEG) * (rng.random() < AWAY)
        time_s += rng.uniform(*FIXATION_S)
    smooth: NDArray[np.float64] = gaussian_filter1d(gaze, 0.012 * fps, axis=0, mode="nearest")
    return smooth


def _blinks(feelings: Feelings, count: int, fps: float, rng: np.random.Generator) -> NDArray[np.float64]:
    times = np.arange(count) / fps
    shares = np.clip(feelings.brows, 0.0, 1.0)
    rarer = 1.0 + shares @ np.array([BLINK_EVERY[emotion] - 1.0 for emotion in feelings.emotions])
    closed = np.zeros(count)
    start_s = rng.uniform(0.3, 1.5)
    while start_s + SHUT_S + STAY_S < times[-1]:
        since = times - start_s
        falling, rising = since / SHUT_S, 1.0 - (since - SHUT_S - STAY_S) / OPEN_S
        closed = np.maximum(closed, np.clip(np.minimum(falling, rising), 0.0, 1.0))
        start_s += rng.uniform(*BETWEEN_BLINKS_S) * rarer[min(round(start_s * fps), count - 1)]
    return closed * closed * (3 - 2 * closed)
