"""What the mouth is busy with: closures, vowels, other sounds, silence; and how much random motion belongs there."""

from collections.abc import Mapping

import numpy as np

from .arrays import Floats, Ints
from .filters import gaussian
from .phones import BILABIALS, SILENCE, VOWELS
from .speech import PhoneTrack

STATES = ("closure", "vowel", "consonant", "silence", "unknown")
"""`closure`: p, b and m; `unknown`: nobody said which phones are spoken."""
FADING_S = 0.03
"""Standard deviation of the smoothing by which amounts come and go."""


def phones_are_known(phones: PhoneTrack) -> bool:
    """Whether anything but silence is said to be spoken."""
    return any(label != SILENCE for label in phones.labels)


def frame_states(phones: PhoneTrack, fps: float, count: int) -> Ints:
    """[count] number in STATES of each frame; frames after the last phone belong to it."""
    if not phones_are_known(phones):
        return np.full(count, STATES.index("unknown"))
    each = np.array([STATES.index(state_of(label)) for label in phones.labels])
    of_frames = np.repeat(each, np.diff(phones.frame_bounds(fps)))
    return np.pad(of_frames, (0, max(0, count - len(of_frames))), mode="edge")[:count]


def state_of(phone: str) -> str:
    """The state that a phone is spoken in."""
    if phone == SILENCE:
        return "silence"
    return "closure" if phone in BILABIALS else "vowel" if phone in VOWELS else "consonant"


def amounts_along(amounts: Mapping[str, float], phones: PhoneTrack, fps: float, count: int) -> Floats:
    """[count] the amount of each frame's state, smoothed, and no more than a closure's within one."""
    states = frame_states(phones, fps, count)
    by_state = np.array([amounts[name] for name in STATES])
    return np.minimum(gaussian(by_state[states], FADING_S * fps), np.where(states == 0, by_state[0], np.inf))
