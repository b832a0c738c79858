"""What phones tell of the face around the mouth: which are said around a moment, how near the beginning and the end are."""

import numpy as np

from .arrays import Floats
from .filters import gaussian
from .phones import VISEME_CLASSES, viseme_of
from .speech import PhoneTrack

AROUND_S = 0.05
"""Standard deviation of the window in which phones count."""
NEAR_S = (0.15, 0.5)
"""The nearness of the beginning and of the end falls by 1/e in these times."""
CONTEXT = len(VISEME_CLASSES) + 2 * len(NEAR_S)
"""Numbers for a moment."""


def context_of(phones: PhoneTrack, count: int, fps: float) -> Floats:
    """[count, CONTEXT] share of each viseme class around each frame, then exp(-t / tau) since the beginning and until the end."""
    times_s = np.arange(count) / fps
    return np.concatenate([_classes(phones, times_s, fps), _nearness(times_s, phones.duration_s)], axis=1)


def _classes(phones: PhoneTrack, times_s: Floats, fps: float) -> Floats:
    at = np.minimum(np.searchsorted(phones.ends_s, times_s, side="right"), len(phones) - 1)
    said = np.eye(len(VISEME_CLASSES))[[viseme_of(label) for label in phones.labels]][at]
    return gaussian(said, AROUND_S * fps) if len(said) else said


def _nearness(times_s: Floats, duration_s: float) -> Floats:
    since, until = times_s[:, None], np.maximum(duration_s - times_s, 0)[:, None]
    return np.exp(-np.concatenate([since, until], axis=1)[:, :, None] / NEAR_S).reshape(len(times_s), -1)
