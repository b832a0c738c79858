"""Filling triangles with what is linear in them, pixel by pixel, on a processor."""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

EDGE = 1e-4
"""px: pixels this far outside a triangle still belong to it, so that rounding leaves no holes along edges."""


def fill(vertices: NDArray[Any], values: NDArray[Any], triangles: NDArray[Any], out: NDArray[Any]) -> None:
    """Draw values [N, V, D] at vertices [N, V, 2] (x, y) px, linear in each triangle [F, 3], over `out` [N, H, W, D] float32.

    What lies outside the triangles stays; where they overlap, the last one counts.
    """
    _fill(vertices.astype(np.float64), values.astype(np.float64), triangles, out)


@njit(cache=True, nogil=True)
def _fill(vertices: NDArray[Any], values: NDArray[Any], triangles: NDArray[Any], out: NDArray[Any]) -> None:
    pictures, height, width, channels = out.shape
    across, down = np.empty(channels), np.empty(channels)
    for n in range(pictures):
        for f in range(len(triangles)):
            a, b, c = triangles[f]
            ax, ay = vertices[n, a]
            bx, by = vertices[n, b, 0] - ax, vertices[n, b, 1] - ay
            cx, cy = vertices[n, c, 0] - ax, vertices[n, c, 1] - ay
            area = bx * cy - by * cx
            flat = abs(area) < 1e-12
            for d in range(channels):
                to_b, to_c = values[n, b, d] - values[n, a, d], values[n, c, d] - values[n, a, d]
                across[d] = 0.0 if flat else (to_b * cy - to_c * by) / area
                down[d] = 0.0 if flat else (to_c * bx - to_b * cx) / area
            top = max(int(np.ceil(ay + min(0.0, by, cy) - EDGE)), 0)
            bottom = min(int(np.floor(ay + max(0.0, by, cy) + EDGE)), height - 1)
            for y in range(top, bottom + 1):
                left, right = _crossed(vertices[n], triangles[f], y)
                first = max(int(np.ceil(left - EDGE)), 0)
                last = min(int(np.floor(right + EDGE)), width - 1)
                for d in range(channels):
                    value = values[n, a, d] + across[d] * (first - ax) + down[d] * (y - ay)
                    step = across[d]
                    for x in range(first, last + 1):
                        out[n, y, x, d] = value + step * (x - first)


@njit(cache=True, nogil=True)
def _crossed(vertices: NDArray[Any], triangle: NDArray[Any], y: int) -> tuple[float, float]:
    """Leftmost and rightmost x where a triangle meets the line y; a level edge gives its ends through its neighbours."""
    left, right = np.inf, -np.inf
    for corner in range(3):
        x0, y0 = vertices[triangle[corner]]
        x1, y1 = vertices[triangle[(corner + 1) % 3]]
        rise, above = y1 - y0, y - y0
        if min(rise, 0.0) - EDGE <= above <= max(rise, 0.0) + EDGE:
            share = 0.0 if rise == 0 else min(max(above / rise, 0.0), 1.0)
            x = x0 + share * (x1 - x0)
            left, right = min(left, x), max(right, x)
    if left > right:
        return 1.0, 0.0
    return left, right
