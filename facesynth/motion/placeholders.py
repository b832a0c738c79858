"""Numbers near the face that programs write for a marker that they do not see, such as -99, -99, -99."""

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.long_arrays import by_blocks, by_overlapping_blocks, row_blocks

SHORTEST_RUN = 3
"""Frames for which a place must stand exactly: no marker that is measured does, unless its file has few digits."""
MOST_STILL = 0.6
"""Where a larger share of the markers stands still the face rests, or the file has few digits."""
BESIDE = 0.1
"""A place whose coordinates differ is outside of the face from this share of its largest extent on."""


def placeholders(points: NDArray[np.floating], known: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """[T, K] which of the points [T, K, 3 or 2] stand exactly, for SHORTEST_RUN frames or more, where no face is.

    known: [T, K] those that are missing for another reason. None in a file whose markers mostly stand still. Equal
    coordinates count wherever they lie outside of all places that markers pass through; others only further off, while most
    markers move, and of a marker that is also measured.
    """
    held = by_overlapping_blocks(_held, points, SHORTEST_RUN - 1).astype(bool)
    alike = by_blocks(_alike, points, bool)
    present = by_blocks(lambda rows: np.asarray(np.isfinite(rows).all(axis=2)), points, bool) & ~known
    free = present & ~held & ~alike
    if not (present & held).any() or free.sum() <= (1 - MOST_STILL) * (present & ~alike).sum():
        return np.zeros(held.shape, bool)
    low, high = _box(points, free)
    outside = by_blocks(lambda rows: _beyond(rows, low, high, 0.0), points, bool)
    margin = BESIDE * float((high - low).max())
    far = by_blocks(lambda rows: _beyond(rows, low, high, margin), points, bool)
    lively = (held & present).sum(axis=1, keepdims=True) < MOST_STILL * present.sum(axis=1, keepdims=True)
    equal = present & held & alike & outside
    values = np.unique(points[equal][:, 0])
    same = by_blocks(lambda rows: np.isin(rows[..., 0], values), points, bool) & alike & present
    return same | (present & held & far & lively & free.any(axis=0))


def _held(points: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Where a place is the same in SHORTEST_RUN frames in a row, of which this is one."""
    whole = np.zeros(points.shape[:2], bool)
    steady = (points[1:] == points[:-1]).all(axis=2)
    count = len(steady) - SHORTEST_RUN + 2
    if count <= 0:
        return whole
    runs = np.all([steady[k : k + count] for k in range(SHORTEST_RUN - 1)], axis=0)
    for k in range(SHORTEST_RUN):
        whole[k : k + count] |= runs
    return whole


def _alike(points: NDArray[np.floating]) -> NDArray[np.bool_]:
    return np.asarray((points == points[..., :1]).all(axis=2))


def _box(points: NDArray[np.floating], free: NDArray[np.bool_]) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """The least and the largest coordinates [3] of the points that are free."""
    low, high = np.full(points.shape[2], np.inf), np.full(points.shape[2], -np.inf)
    for rows in row_blocks(points):
        some = points[rows][free[rows]]
        low, high = (
            np.fmin(low, np.fmin.reduce(some, axis=0, initial=np.inf)),
            np.fmax(high, np.fmax.reduce(some, axis=0, initial=-np.inf)),
        )
    return low, high


def _beyond(
    points: NDArray[np.floating], low: NDArray[np.floating], high: NDArray[np.floating], margin: float
) -> NDArray[np.bool_]:
    return np.asarray(((points < low - margin) | (points > high + margin)).any(axis=2))
