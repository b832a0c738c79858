"""Furrows of the built-in head: lines that show where its skin is pushed together, and only there.

The drawn mesh has a point every 4 mm, furrows are 2 mm wide: they are shading. How far skin is pushed together is read off the
posed points (the area around each over its area at rest), so that no weight needs to be known. Places are millimetres on this one
head at rest, from between the eyes.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from facesynth.face.draw.light import smoothstep

FROWN_MM, FROWN_SLANT, FROWN_WIDTH_MM = 5.6, 0.13, 1.5
"""Two lines between the brows, so far from the middle 12 mm over the eyes and by so much more for each mm over that."""
FOREHEAD_MM, FOREHEAD_WIDTH_MM = (33.0, 40.0, 47.0), 1.6
"""Heights of the lines across the forehead."""
FOREHEAD_SHARE = 0.5
"""How deep those are beside the lines of a frown: it is a young face."""
DEPTH_MM = 0.5


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def vertex_areas(points: NDArray[Any], quads: NDArray[Any]) -> NDArray[np.float32]:
    """[N] area of the quads [F, 4] around each of points [N, 3]: half the cross product of the diagonals of each."""
    areas = np.zeros(len(points), np.float32)
    for q in range(len(quads)):
        a, b, c, d = quads[q, 0], quads[q, 1], quads[q, 2], quads[q, 3]
        ux, uy, uz = points[c, 0] - points[a, 0], points[c, 1] - points[a, 1], points[c, 2] - points[a, 2]
        vx, vy, vz = points[d, 0] - points[b, 0], points[d, 1] - points[b, 1], points[d, 2] - points[b, 2]
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        area = np.float32(0.5) * np.sqrt(nx * nx + ny * ny + nz * nz)
        for k in range(4):
            areas[quads[q, k]] += area
    return areas


def pushed_together(points: NDArray[Any], quads: NDArray[Any], rest_areas: NDArray[np.float32]) -> NDArray[np.float32]:
    """[N] share of its area at rest that the skin around each point has lost, 0..1."""
    left = vertex_areas(points, quads) / np.maximum(rest_areas, 1e-6)
    return np.maximum(1 - left, 0).astype(np.float32)


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def furrow(x: float, y: float, z: float, lost: float) -> tuple[float, float, float]:
    """Depth 0..1 of the furrow at a place of the face at rest, and its slopes sideways and up, where skin lost such a share."""
    across, deep, slope_x, slope_y = abs(x), 0.0, 0.0, 0.0
    if z < 95.0 or across > 45.0 or y < 0.0 or y > 56.0:
        return deep, slope_x, slope_y
    u = (across - FROWN_MM - FROWN_SLANT * (y - 12.0)) / FROWN_WIDTH_MM
    line = np.exp(-u * u) * smoothstep(0.0, 7.0, y) * smoothstep(27.0, 19.0, y) * smoothstep(0.12, 0.40, lost)
    deep += line
    slope_x += DEPTH_MM * 2.0 * u / FROWN_WIDTH_MM * line * (1.0 if x > 0 else -1.0)
    whole = FOREHEAD_SHARE * smoothstep(44.0, 22.0, across) * smoothstep(0.08, 0.28, lost)
    for k in range(len(FOREHEAD_MM)):
        v = (y - FOREHEAD_MM[k] - 0.8 * np.sin(0.11 * x + 2.0 * k) + 0.0016 * x * x) / FOREHEAD_WIDTH_MM
        line = np.exp(-v * v) * whole
        deep += line
        slope_y += DEPTH_MM * 2.0 * v / FOREHEAD_WIDTH_MM * line
    return min(deep, 1.0), slope_x, slope_y
