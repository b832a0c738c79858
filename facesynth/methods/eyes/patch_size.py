"""How long a patch of recorded eyes must be to hold what eyes do (Deng 2006, §3.4)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.arrays import Floats
from facesynth.inference.gaze import gaze_shifts

SHUT = 0.2
"""Opening under which the dissertation counts an approximate blink."""
LARGE_RAD = 0.1
"""A saccade is large from this movement sideways or up and down on; the dissertation's 0.1 of a unit that it does not state."""


@dataclass(frozen=True, eq=False)
class PatchSize:
    """What the intervals between large eye movements say."""

    intervals: NDArray[np.int64]
    """[I] frames between two blinks, or two large saccades, that follow each other; rising."""
    frames: int
    """Where the cumulative curve bends: the patch."""

    def covered(self, frames: int) -> float:
        """Share of the intervals that are no longer than so many frames."""
        return float((self.intervals <= frames).mean())


def patch_size(pieces: list[Floats], fps: float) -> PatchSize | None:
    """Of pieces [T, 3] of opening and gaze; None where no two blinks or saccades follow each other."""
    intervals = np.sort(np.concatenate([np.zeros(0, np.int64), *(_intervals(piece, fps) for piece in pieces)]))
    return PatchSize(intervals, knee(intervals)) if len(intervals) else None


# The curve of the share F(x) of intervals up to x bends where it is farthest above the straight line from its beginning
# to its end:  the x of the largest  F(x) - x / x_max.
def knee(intervals: NDArray[np.int64]) -> int:
    """The bend of the cumulative curve of intervals [I], frames, rising; they need not differ."""
    share = np.arange(1, len(intervals) + 1) / len(intervals)
    return int(intervals[np.argmax(share - intervals / intervals[-1])])


def _intervals(piece: Floats, fps: float) -> NDArray[np.int64]:
    shut = piece[:, 0] < SHUT
    blinks = np.flatnonzero(shut[1:] & ~shut[:-1])
    saccades = [shift.start for shift in gaze_shifts(piece[:, 1:], fps) if np.abs(shift.step).max() > LARGE_RAD]
    return np.concatenate([np.diff(blinks), np.diff(np.array(saccades, np.int64))]).astype(np.int64)
