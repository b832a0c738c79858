"""Matching the frames of two motions in time, so that what is late is not taken for what is wrong."""

import numba
import numpy as np
from numpy.typing import NDArray

from facesynth.evaluation.pair import Array

LONGEST_SHIFT_S = 0.1
"""A movement is looked for at most so far from where it was recorded, s."""


def aligned_distances(mine: Array, yours: Array, fps: float) -> Array:
    """[T] mean distance of the points of each frame of `yours` [T, K, dimension] from the frames of `mine` that match it.

    Frames are matched by dynamic time warping of the points themselves, within 100 ms; a frame that matches several
    gets their mean. NaN points, missing in both, count for nothing; a frame without points is NaN.
    """
    seen = np.asarray(~np.isnan(yours).any(axis=2))
    flat = [np.nan_to_num(points).reshape(len(points), -1) for points in (mine, yours)]
    path = dtw_path(flat[0], flat[1], max(1, round(LONGEST_SHIFT_S * fps)))
    apart = np.linalg.norm(flat[0][path[:, 0]].reshape(len(path), *yours.shape[1:]) - np.nan_to_num(yours)[path[:, 1]], axis=2)
    counted = seen[path[:, 1]] & seen[path[:, 0]]
    share = np.where(counted, apart, 0.0).sum(axis=1), counted.sum(axis=1)
    total, count = (np.bincount(path[:, 1], weights=values, minlength=len(yours)) for values in share)
    return np.divide(total, count, out=np.full(len(yours), np.nan), where=count > 0)


@numba.njit(cache=True)
def dtw_path(mine: Array, yours: Array, radius: int) -> NDArray[np.int64]:
    """[P, 2] pairs of frames of mine [T, D] and yours [T, D] of least summed squared distance, monotone, |i - j| <= radius.

    Own routine: each cell needs its left neighbour, which no array operation expresses, and no
    dynamic time-warping package is worth a dependency for thirty lines. Only the band is kept:
    cell (i, j), counted from 1, lies in column j - i + radius, so that (i-1, j-1) is in the same
    column, (i-1, j) one to the right and (i, j-1) one to the left.
    """
    length, width = len(mine), 2 * radius + 1
    cost = np.full((length + 1, width + 2), np.inf)  # one column of walls on either side
    cost[0, radius + 1] = 0.0
    for i in range(1, length + 1):
        for k in range(max(1, radius + 2 - i), min(width, length - i + radius + 1) + 1):
            j = i + k - radius - 1
            before = min(cost[i - 1, k], cost[i - 1, k + 1], cost[i, k - 1])
            apart = 0.0
            for d in range(mine.shape[1]):
                apart += (mine[i - 1, d] - yours[j - 1, d]) ** 2
            cost[i, k] = apart + before
    path = np.empty((2 * length, 2), np.int64)
    count, i, k = 0, length, radius + 1
    while i > 0:
        path[count, 0], path[count, 1] = i - 1, i + k - radius - 2
        count += 1
        across, up, left = cost[i - 1, k], cost[i - 1, k + 1], cost[i, k - 1]
        if across <= up and across <= left:
            i -= 1
        elif up <= left:
            i, k = i - 1, k + 1
        else:
            k -= 1
    return path[:count][::-1]
