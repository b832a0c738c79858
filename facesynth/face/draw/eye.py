"""The eye: a white ball, a cornea, an iris behind it, tears."""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from facesynth.face.draw.light import FILL, KEY, reflect, smoothstep, unit


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def eye_colour(
    p: tuple[float, float, float], v: tuple[float, float, float], eyes: NDArray[Any], which: int, key: float
) -> tuple[float, float, float]:
    """An eyeball of radius 14.5 mm with a cornea of radius 7.8 mm in front of a flat iris.

    The ray is refracted at the cornea and met with the plane of the iris, so that the iris lies behind
    its window; the sclera darkens under the lids and towards the corners. Lengths are this mesh's: the cornea's centre lies
    9.5 mm in front of the eye's, so the two spheres meet 7.2 mm off the axis; the window fades within, from 5.4 to 6.6 mm.
    """
    dx, dy, dz = p[0] - eyes[which, 3, 0], p[1] - eyes[which, 3, 1], p[2] - eyes[which, 3, 2]
    ex, ey, ez = _in_eye(eyes, which, (dx, dy, dz))
    ux, uy, uz = unit(ex, ey, ez)
    cx, cy, cz = unit(ex, ey, ez - 9.5)
    window = (1.0 - smoothstep(5.4, 6.6, 14.5 * np.sqrt(ux * ux + uy * uy))) if uz > 0 else 0.0
    nx, ny, nz = unit(ux + (cx - ux) * window, uy + (cy - uy) * window, uz + (cz - uz) * window)
    world = _in_world(eyes, which, (nx, ny, nz))
    side = smoothstep(7.0, 13.0, abs(dx))
    shade = (1.0 - 0.62 * smoothstep(0.5, 5.5, dy)) * (1.0 - 0.35 * smoothstep(-3.0, -7.0, dy)) * (1.0 - 0.35 * side)
    white = (0.60, 0.555 - 0.10 * side, 0.52 - 0.11 * side)
    red, green, blue = reflect(white, world, v, (0.35 + 0.65 * key) * shade, shade, 0.6, 0.0, 5, 0.3 * shade)
    if window > 0:
        ired, igreen, iblue = _iris((ex, ey, ez), (cx, cy, cz), _in_eye(eyes, which, v), eyes, which, key)
        red += (ired * shade - red) * window
        green += (igreen * shade - green) * window
        blue += (iblue * shade - blue) * window
    return _with_tears(red, green, blue, world, v, shade, window)


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _in_eye(eyes: NDArray[Any], which: int, x: tuple[float, float, float]) -> tuple[float, float, float]:
    """A direction in the axes of an eye."""
    return (
        eyes[which, 0, 0] * x[0] + eyes[which, 0, 1] * x[1] + eyes[which, 0, 2] * x[2],
        eyes[which, 1, 0] * x[0] + eyes[which, 1, 1] * x[1] + eyes[which, 1, 2] * x[2],
        eyes[which, 2, 0] * x[0] + eyes[which, 2, 1] * x[1] + eyes[which, 2, 2] * x[2],
    )


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _in_world(eyes: NDArray[Any], which: int, x: tuple[float, float, float]) -> tuple[float, float, float]:
    """A direction in the axes of an eye, back in the world's."""
    return (
        eyes[which, 0, 0] * x[0] + eyes[which, 1, 0] * x[1] + eyes[which, 2, 0] * x[2],
        eyes[which, 0, 1] * x[0] + eyes[which, 1, 1] * x[1] + eyes[which, 2, 1] * x[2],
        eyes[which, 0, 2] * x[0] + eyes[which, 1, 2] * x[1] + eyes[which, 2, 2] * x[2],
    )


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _iris(
    e: tuple[float, float, float],
    n: tuple[float, float, float],
    v: tuple[float, float, float],
    eyes: NDArray[Any],
    which: int,
    key: float,
) -> tuple[float, float, float]:
    """The iris 13.2 mm in front of the eye's centre, seen through the cornea at e with normal n along v, in its axes."""
    ex, ey, ez = e
    nx, ny, nz = n
    vx, vy, vz = v
    cosine = max(nx * vx + ny * vy + nz * vz, 0.05)
    inside = 0.75 * cosine - np.sqrt(max(1.0 - 0.5625 * (1.0 - cosine * cosine), 0.0))
    rx, ry, rz = -0.75 * vx + inside * nx, -0.75 * vy + inside * ny, -0.75 * vz + inside * nz
    reach = (13.2 - ez) / min(rz, -0.2)
    qx, qy = ex + reach * rx, ey + reach * ry
    radius = np.sqrt(qx * qx + qy * qy)
    angle = np.arctan2(qy, qx)
    fibre = (
        0.5
        + 0.22 * np.sin(23.0 * angle + 2.1 * np.sin(3.0 * angle) + 0.6 * radius)
        + 0.20 * np.sin(41.0 * angle - 1.7 * np.sin(5.0 * angle))
    )
    inner = 1.0 - smoothstep(2.3, 4.2, radius)
    red = 0.085 + 0.15 * inner + 0.05 * fibre
    green = 0.105 + 0.05 * inner + 0.06 * fibre
    blue = 0.105 - 0.045 * inner + 0.065 * fibre
    lx, ly, _ = _in_eye(eyes, which, (KEY[0], KEY[1], KEY[2]))
    gathered = 0.75 + 0.75 * max(0.0, -(qx * lx + qy * ly) / 5.0)  # the cornea focuses the key light on the far side
    light = (0.40 + 1.15 * (0.35 + 0.65 * key)) * gathered
    light *= (1.0 - 0.78 * smoothstep(4.3, 5.9, radius)) * (1.0 - 0.5 * (1.0 - smoothstep(2.1, 2.9, radius)))
    light *= smoothstep(1.75, 2.25, radius)
    return red * light + 0.004, green * light + 0.004, blue * light + 0.004


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _with_tears(
    red: float,
    green: float,
    blue: float,
    n: tuple[float, float, float],
    v: tuple[float, float, float],
    shade: float,
    window: float,
) -> tuple[float, float, float]:
    """The wet surface mirrors the key light as a soft box, and the fill faintly."""
    twice = 2.0 * (n[0] * v[0] + n[1] * v[1] + n[2] * v[2])
    mx, my, mz = twice * n[0] - v[0], twice * n[1] - v[1], twice * n[2] - v[2]
    key = smoothstep(0.962, 0.982, mx * KEY[0] + my * KEY[1] + mz * KEY[2])
    fill = smoothstep(0.90, 0.98, mx * FILL[0] + my * FILL[1] + mz * FILL[2])
    shine = (1.9 * key * (0.25 + 0.75 * window) + 0.04 * fill) * smoothstep(0.15, 0.7, shade) + 0.018 * shade * max(my, 0.0)
    return red + shine, green + shine, blue + shine
