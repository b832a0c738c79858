"""Missing samples: which are filled, which stay missing, and an account of both."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.errors import FacesynthError
from facesynth.inference.long_arrays import by_blocks, joined, row_blocks
from facesynth.inference.motion import Motion

LONGEST_S = 0.1
"""Longest gap that is filled, seconds: about the shortest movement that one could miss."""


@dataclass(frozen=True)
class Gap:
    """Frames `start` to `stop` (exclusive) in which one point is missing."""

    point: int
    start: int
    stop: int

    def __len__(self) -> int:
        return self.stop - self.start


@dataclass(frozen=True)
class GapReport:
    """What `fill_gaps` did. A sample is one point in one frame."""

    samples: int
    """Samples there are: frames times points."""
    filled_samples: int
    """Samples that were missing and are filled."""
    long_gaps: tuple[Gap, ...]
    """Gaps left open: too long, or at the first or last frame."""

    @property
    def missing_samples(self) -> int:
        """Samples that are still missing."""
        return sum(len(gap) for gap in self.long_gaps)


def fill_gaps(
    frames: NDArray[np.float32], fps: float, dimension: int, longest_s: float = LONGEST_S
) -> tuple[NDArray[np.float32], GapReport]:
    """Fill short gaps by cubic interpolation in time; longer ones, and those at the edges, stay NaN.

    frames: [T, K * dimension], NaN where a sample is missing. A point with one missing coordinate is missing.
    Returns the filled copy [T, K * dimension] and the account.
    """
    if frames.ndim != 2 or frames.shape[1] % dimension:
        raise FacesynthError(f"frames must have shape [T, K * {dimension}]; got {frames.shape}")
    points = frames.reshape(len(frames), -1, dimension).copy()
    missing = missing_in(points)
    points[missing] = np.nan
    longest = int(np.floor(longest_s * fps + 1e-6))
    gaps = [gap for k in np.flatnonzero(missing.any(axis=0)) for gap in runs(missing[:, k], int(k))]
    short = [gap for gap in gaps if gap.start > 0 and gap.stop < len(frames) and len(gap) <= longest]
    for k in sorted({gap.point for gap in short}):
        _interpolate(points[:, k], ~missing[:, k], [gap for gap in short if gap.point == k])
    left = sorted(set(gaps) - set(short), key=lambda gap: (gap.point, gap.start))
    return points.reshape(frames.shape), GapReport(missing.size, sum(map(len, short)), tuple(left))


def for_looking(motion: Motion) -> Motion:
    """A recording with every gap filled, so that it can be shown; whoever learns or measures leaves long gaps open.

    Gaps inside are interpolated, those at the edges hold the nearest sample; a point that is never seen rests at 0, or at its
    place in the layout's neutral pose where that is known.
    """
    frames, _ = fill_gaps(motion.frames, motion.fps, motion.layout.dimension, longest_s=motion.duration_s + 1)
    for channel in np.flatnonzero(np.isnan(frames).any(axis=0)):
        known = np.flatnonzero(np.isfinite(frames[:, channel]))
        if len(known):
            frames[:, channel] = np.interp(np.arange(len(frames)), known, frames[known, channel])
        else:
            frames[:, channel] = 0.0 if motion.layout.neutral is None else motion.layout.neutral[channel]
    return replace(motion, frames=frames, head=_held(motion.head), eyes=_held(motion.eyes))


def _held(part: NDArray[np.float32] | None) -> NDArray[np.float32] | None:
    """Head or eyes [T, n] with gaps filled from beside; None where nothing of it was recorded."""
    if part is None or not np.isfinite(part).all(axis=1).any():
        return None
    known = np.flatnonzero(np.isfinite(part).all(axis=1))
    return np.stack([np.interp(np.arange(len(part)), known, column[known]) for column in part.T], axis=1).astype(np.float32)


def missing_in(values: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Where any value along the last axis is NaN: [..., n] → [...]."""
    return np.asarray(np.isnan(values).any(axis=-1))


LOOKED_AT = 1024
"""Frames of a long recording that tell where the body is."""
FAR = 10.0
"""A point further from the middle of all than this many times their usual distance is no place on the same body."""


def filled_in(points: NDArray[np.floating]) -> NDArray[np.bool_]:
    """[T, K] which of the points [T, K, 3 or 2] are no places but what programs write for a gap: 0, 0, 0, or a number far away.

    Such numbers (-16512, 9999.999, 99999, …) stand in all coordinates, or in one; a marker at exactly nothing but zeros,
    or metres from the face, there is none.
    """
    step = max(1, len(points) // LOOKED_AT)
    some = joined((points[rows][-rows.start % step :: step] for rows in row_blocks(points)), points.dtype)
    present = np.isfinite(some).all(axis=2) & ~_zeros(some)
    likely = some[present & ~_alike(some)]
    if len(likely) < 3:
        return by_blocks(_zeros, points, bool)
    middle = np.median(likely, axis=0)
    far = FAR * max(float(np.median(np.abs(likely - middle).max(axis=1))), 1e-9)
    commonest = _commonest_extremes(points)

    def gaps(rows: NDArray[np.floating]) -> NDArray[np.bool_]:
        there = np.isfinite(rows).all(axis=2) & ~_zeros(rows)
        away = np.abs(np.nan_to_num(rows, posinf=np.inf, neginf=-np.inf) - middle).max(axis=2)
        again = np.stack([np.isin(rows[..., axis], values) for axis, values in enumerate(commonest)]).any(axis=0)
        return _zeros(rows) | np.isinf(rows).any(axis=2) | (there & (away > far) & (_alike(rows) | again))

    return by_blocks(gaps, points, bool)


def _zeros(points: NDArray[np.floating]) -> NDArray[np.bool_]:
    return ~np.nan_to_num(points, nan=1.0).any(axis=2)


def _alike(points: NDArray[np.floating]) -> NDArray[np.bool_]:
    return np.asarray((points == points[..., :1]).all(axis=-1))


def _commonest_extremes(points: NDArray[np.floating]) -> list[list[float]]:
    """Of each axis the least and the largest value, where it stands more than once: no two measured ones are the same."""
    lowest, highest = np.full(points.shape[2], np.inf), np.full(points.shape[2], -np.inf)
    for rows in row_blocks(points):
        known = ~np.isnan(points[rows])
        lowest = np.minimum(lowest, points[rows].min(axis=(0, 1), initial=np.inf, where=known))
        highest = np.maximum(highest, points[rows].max(axis=(0, 1), initial=-np.inf, where=known))
    ends = np.stack([lowest, highest])  # [2, 3]
    counts = sum((points[rows, :, None] == ends).sum(axis=(0, 1)) for rows in row_blocks(points))
    return [column[count > 1].tolist() for column, count in zip(ends.T, np.transpose(counts), strict=True)]


def runs(missing: NDArray[np.bool_], point: int = 0) -> list[Gap]:
    """The runs of True in a mask [T], in order."""
    edges = np.flatnonzero(np.diff(missing.astype(np.int8), prepend=0, append=0))
    return [Gap(point, int(start), int(stop)) for start, stop in edges.reshape(-1, 2)]


def _interpolate(track: NDArray[np.float32], present: NDArray[np.bool_], gaps: list[Gap]) -> None:
    """Fill the gaps of one point's track [T, dimension] in place."""
    from scipy.interpolate import CubicSpline

    known = np.flatnonzero(present)
    wanted = np.concatenate([np.arange(gap.start, gap.stop) for gap in gaps])
    track[wanted] = CubicSpline(known, track[known].astype(np.float64))(wanted)
