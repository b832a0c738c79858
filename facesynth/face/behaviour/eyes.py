"""Quiet natural eyes for a face whose own were not recorded: blinks, small gaze shifts, a look held while the head moves."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.speech import PhoneTrack


class EyeMotion(Protocol):
    """Whatever moves the eyes of a face that was recorded without them."""

    def __call__(self, head: NDArray[np.floating], fps: float, phones: PhoneTrack | None, seed: int) -> NDArray[np.float64]:
        """[T, 3] as in `Motion.eyes`: opening of the lids (0 shut, 1 open), gaze to the performer's left and up (rad).

        Parameters
        ----------
        head : [T, 6] rotation vector (rad) and translation (mm)
        phones : what is said meanwhile, where that is known
        """
        ...


def still_eyes(head: NDArray[np.floating], fps: float, phones: PhoneTrack | None, seed: int) -> NDArray[np.float64]:
    """An `EyeMotion` that leaves the eyes open and straight."""
    return np.tile([1.0, 0.0, 0.0], (len(head), 1))


BLINK_MEDIAN_S, BLINK_SPREAD = 3.0, 0.5
"""Pauses between blinks are log-normal: median 3.0 s, deviation .5 of the logarithm, so 17 blinks a minute.

People who talk blink 15 to 26 times a minute; the pauses are skewed, never regular."""
CLOSING_S, SHUT_S, OPENING_S = 0.07, 0.03, 0.16
"""A lid falls about twice as fast as it rises."""
FIXATION_S = (0.5, 2.0)
"""A gaze rests this long, uniformly."""
GAZE_SPREAD_RAD = np.radians([2.4, 1.3])
"""Standard deviation of where it rests, sideways and up; one time in three it returns to straight ahead."""
HEAD_SHARE = 0.6
"""Share of the head's turn that the eyes take back, so that they keep looking at the viewer."""


def quiet_eyes(head: NDArray[np.floating], fps: float, phones: PhoneTrack | None, seed: int) -> NDArray[np.float64]:
    """An `EyeMotion` by constants: blinks and rests at random, whatever is said, and a look held while the head moves."""
    shut = quiet_blinks(len(head), fps, seed)
    gaze = quiet_gaze(len(head), fps, seed) + holding_the_viewer(head)
    return np.concatenate([1 - shut[:, None], gaze], axis=1)


def quiet_blinks(count: int, fps: float, seed: int) -> NDArray[np.float64]:
    """[T] how far the lids are shut, 0..1. The same seed blinks at the same times at any rate."""
    rng = np.random.default_rng([seed, 1])
    times = np.arange(count) / fps
    shut = np.zeros(count)
    start = rng.uniform(0.3, 2.5)
    while start < count / fps:
        falling = (times - start) / CLOSING_S
        rising = 1 - (times - start - CLOSING_S - SHUT_S) / OPENING_S
        shut = np.maximum(shut, np.clip(np.minimum(falling, rising), 0, 1))
        start += max(0.6, rng.lognormal(np.log(BLINK_MEDIAN_S), BLINK_SPREAD))
    return shut * shut * (3 - 2 * shut)


def quiet_gaze(count: int, fps: float, seed: int) -> NDArray[np.float64]:
    """[T, 2] gaze to the performer's left and up (rad): small saccades between rests."""
    rng = np.random.default_rng([seed, 2])
    knots, targets = [0.0], [np.zeros(2)]
    time = rng.uniform(*FIXATION_S)
    while time < count / fps:
        target = rng.normal(0, GAZE_SPREAD_RAD) * (rng.random() < 2 / 3)
        degrees = np.degrees(np.linalg.norm(target - targets[-1]))
        knots += [time, time + 0.021 + 0.0022 * degrees]  # duration grows with the size of a saccade
        targets += [targets[-1], target]
        time += rng.uniform(*FIXATION_S)
    times = np.arange(count) / fps
    return np.stack([np.interp(times, knots, column) for column in np.array(targets).T], axis=1)


def holding_the_viewer(head: NDArray[np.floating]) -> NDArray[np.float64]:
    """[T, 2] gaze that takes back a share of the turn of head [T, 6]."""
    return HEAD_SHARE * np.stack([-head[:, 1], head[:, 0]], axis=1).astype(np.float64)
