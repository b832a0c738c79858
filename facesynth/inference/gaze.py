"""What eyes do with a place to look at: hold it while the head moves, let the head take wide shifts over, stop at their reach.

Angles [T, 2] are to the performer's left and up, radians.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .arrays import Floats
from .filters import gaussian

REACH_RAD = np.radians((35.0, 25.0))
"""How far eyes turn in the head, sideways and up or down, without strain."""
SWAY_S = 1.0
"""Standard deviation of the smoothing that parts where a head points, which the eyes follow, from the turns that they undo."""
SHIFT_RAD_S = np.radians(30.0)
"""A gaze that is faster than this shifts."""
TURN_RAD = np.radians(15.0)
"""Of a shift that is wider than this the head takes what is beyond it."""
TURNING_S, RETURNING_S = 0.4, 2.0
"""A head takes so long to follow the eyes, and returns with this time constant."""


@dataclass(frozen=True, eq=False)
class Shift:
    """The gaze moves from where it is in frame `start` to where it is in frame `stop`."""

    start: int
    stop: int
    step: Floats
    """[2] rad"""


def facing(head: NDArray[np.floating]) -> Floats:
    """[T, 2] where a head [T, 6] points; turns are small enough for the parts of the rotation vector to be angles."""
    return np.stack([head[:, 1], -head[:, 0]], axis=1).astype(np.float64)


def quick(angles: Floats, fps: float) -> Floats:
    """[T, 2] angles away from where they are on the whole."""
    return angles - gaussian(angles, SWAY_S * fps)


def quick_turns(head: NDArray[np.floating], fps: float) -> Floats:
    """[T, 2] a head's turns away from where it points on the whole."""
    return quick(facing(head), fps)


def gaze_shifts(gaze: NDArray[np.floating], fps: float) -> list[Shift]:
    """The shifts of a gaze [T, 2], in order."""
    fast = np.hypot(*np.diff(gaze, axis=0).T) * fps > SHIFT_RAD_S
    edges = np.flatnonzero(np.diff(np.concatenate([[False], fast, [False]]).astype(np.int8)))
    return [Shift(int(a), int(b), np.asarray(gaze[b] - gaze[a], np.float64)) for a, b in edges.reshape(-1, 2)]


# A shift v turns the head by a = v (1 - 15° / |v|), with the course
#
#   r(t) = (3 - 2 s) s²,  s = t / 0.4 s   while it turns;   r(t) = exp(-(t - 0.4 s) / 2 s)   while it returns.
def head_turns(gaze: NDArray[np.floating], fps: float) -> Floats:
    """[T, 2] how far the head goes along with the wide shifts of a gaze [T, 2]; it follows the eyes and returns slowly."""
    turns, times_s = np.zeros(gaze.shape), np.arange(len(gaze)) / fps
    for shift in gaze_shifts(gaze, fps):
        if (size := float(np.hypot(*shift.step))) > TURN_RAD:
            since_s = times_s[shift.start :] - times_s[shift.start]
            rise = np.clip(since_s / TURNING_S, 0, 1)
            course = rise**2 * (3 - 2 * rise) * np.exp(-np.maximum(since_s - TURNING_S, 0) / RETURNING_S)
            turns[shift.start :] += course[:, None] * shift.step * (1 - TURN_RAD / size)
    return turns


def within_reach(gaze: Floats) -> Floats:
    """A gaze [T, 2] in the head, drawn in to the ellipse of what eyes reach."""
    return gaze / np.maximum(np.hypot(*(gaze / REACH_RAD).T), 1.0)[:, None]
