"""The shadow that the key light throws: a map of depths seen from the light, and how it is looked up."""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

REACH = 2
"""Texels of the shadow map that are looked at to each side of a point."""
_RAMP_MM = 4.0  # an occluder that far in front shades fully


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def lit_share(shadow: NDArray[Any], light: NDArray[Any], x: float, y: float, z: float) -> float:
    """How much of the key light reaches a point, 0..1 (percentage-closer filtering, Reeves et al. 1987).

    Of the texels around, those count that hold nothing nearer to the light, with weights that slide with
    the point, and with a ramp of 4 mm instead of a threshold. Far from any edge of a shadow the nearest and
    the farthest depth around, kept beside each texel, answer at once.
    """
    column = light[0, 0] * x + light[0, 1] * y + light[0, 2] * z + light[0, 3] - 0.5
    row = light[1, 0] * x + light[1, 1] * y + light[1, 2] * z + light[1, 3] - 0.5
    away = light[2, 0] * x + light[2, 1] * y + light[2, 2] * z + light[2, 3] - 0.5
    size = shadow.shape[0]
    if column < REACH or row < REACH or column >= size - 1 - REACH or row >= size - 1 - REACH:
        return 1.0
    c, r = int(column), int(row)
    if away <= shadow[r, c, 1]:
        return 1.0
    if away >= shadow[r, c, 2] + _RAMP_MM:
        return 0.0
    u, v = column - c, row - r
    total = 0.0
    for i in range(-REACH, REACH + 2):
        tall = (1 - v if i == -REACH else v if i == REACH + 1 else 1.0) / (2 * REACH + 1)
        for k in range(-REACH, REACH + 2):
            wide = (1 - u if k == -REACH else u if k == REACH + 1 else 1.0) / (2 * REACH + 1)
            total += tall * wide * min(max(1.0 - (away - shadow[r + i, c + k, 0]) / _RAMP_MM, 0.0), 1.0)
    return total


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def with_bounds(depth: NDArray[Any]) -> NDArray[np.float32]:
    """[S, S, 3] depths [S, S] with the nearest and the farthest one that `lit_share` would look at from each texel."""
    size = depth.shape[0]
    low, high = depth.copy(), depth.copy()
    result = np.empty((size, size, 3), np.float32)
    for r in range(size):
        for k in range(max(r - REACH, 0), min(r + REACH + 1, size - 1) + 1):
            for c in range(size):
                low[r, c] = min(low[r, c], depth[k, c])
                high[r, c] = max(high[r, c], depth[k, c])
    for r in range(size):
        for c in range(size):
            nearest, farthest = low[r, c], high[r, c]
            for k in range(max(c - REACH, 0), min(c + REACH + 1, size - 1) + 1):
                nearest, farthest = min(nearest, low[r, k]), max(farthest, high[r, k])
            result[r, c, 0], result[r, c, 1], result[r, c, 2] = depth[r, c], nearest, farthest
    return result
