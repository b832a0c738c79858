"""The lights of the studio, and what a surface sends on of them, in linear RGB.

A key light from the upper left of the picture, a cool fill from the right, two rims from behind, and a sky dimmed by baked
occlusion.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

Vector = tuple[float, float, float] | NDArray[Any]

KEY = np.array([-0.52, 0.52, 1.0]) / np.linalg.norm([-0.52, 0.52, 1.0])
"""Direction towards the key light."""
FILL = np.array([0.9, 0.05, 0.7]) / np.linalg.norm([0.9, 0.05, 0.7])
RIM = np.array([0.75, 0.5, -0.75]) / np.linalg.norm([0.75, 0.5, -0.75])
BACK = np.array([-0.8, 0.45, -0.8]) / np.linalg.norm([-0.8, 0.45, -0.8])
KEY_COLOUR = np.array([1.95, 1.78, 1.58])
FILL_COLOUR = np.array([0.19, 0.21, 0.25])
RIM_COLOUR = np.array([0.62, 0.70, 0.86])
_SKY = np.array([0.215, 0.215, 0.23])
_GROUND = np.array([0.13, 0.095, 0.078])
_WRAP = np.array([0.24, 0.13, 0.10])  # light that travels through skin past the edge of shadow: red goes farthest


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def smoothstep(low: float, high: float, x: float) -> float:
    """0 below low, 1 above high, smooth between."""
    t = min(max((x - low) / (high - low), 0.0), 1.0)
    return t * t * (3.0 - 2.0 * t)


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def dot(a: Vector, b: Vector) -> float:
    """Of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def unit(x: float, y: float, z: float) -> tuple[float, float, float]:
    """A vector of length 1."""
    scale = 1.0 / np.sqrt(x * x + y * y + z * z + 1e-12)
    return x * scale, y * scale, z * scale


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _lobes(n: tuple[float, float, float], v: tuple[float, float, float], light: NDArray[Any], doublings: int) -> float:
    """Blinn and Phong's highlights with exponents 2 ** doublings and a quarter of it.

    Each is normalised, so that a narrow one carries as much light as a wide one.
    """
    hx, hy, hz = unit(light[0] + v[0], light[1] + v[1], light[2] + v[2])
    value = max(n[0] * hx + n[1] * hy + n[2] * hz, 0.0)
    for _ in range(doublings - 2):
        value *= value
    narrow = value * value
    narrow *= narrow
    return (narrow * ((1 << doublings) + 8) + 0.55 * value * ((1 << (doublings - 2)) + 8)) / 25.0


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def reflect(
    albedo: tuple[float, float, float],
    n: tuple[float, float, float],
    v: tuple[float, float, float],
    key: float,
    sky: float,
    soft: float,
    gloss: float,
    doublings: int,
    rims: float,
) -> tuple[float, float, float]:
    """Light that a surface sends along v; key, sky and rims are visible shares, soft is 1 for flesh, 0 for hard matter.

    Under skin light travels a few millimetres, red farthest: each channel's cosine wraps around the edge of
    shadow by its own amount, and cast shadows and creases lose less red than blue. The gloss grows towards grazing angles as
    Schlick's approximation of Fresnel's law does (a fourth power here), from 0.13 to 1.43 of its value.
    Highlights of the key light end with a ramp of cosines (-0.05 to 0.35), where a threshold would draw a line.
    """
    toward = dot(n, KEY)
    fill = max(0.0, (dot(n, FILL) + 0.25) / 1.25) * sky
    rim = max(0.0, dot(n, RIM)) + 0.7 * max(0.0, dot(n, BACK))
    rim *= rims
    grazing = 1.0 - max(0.0, dot(n, v))
    fresnel = gloss * (0.13 + 1.3 * grazing * grazing * grazing * grazing)
    lit = key * smoothstep(-0.05, 0.35, toward)
    shine = fresnel * (lit * _lobes(n, v, KEY, doublings) + 0.10 * sky * _lobes(n, v, FILL, doublings - 1))
    upward = 0.5 + 0.5 * n[1]
    red = albedo[0] * _irradiance(0, toward, fill, rim, upward, key, sky, soft, albedo[0]) + KEY_COLOUR[0] * shine
    green = albedo[1] * _irradiance(1, toward, fill, rim, upward, key, sky, soft, albedo[1]) + KEY_COLOUR[1] * shine
    blue = albedo[2] * _irradiance(2, toward, fill, rim, upward, key, sky, soft, albedo[2]) + KEY_COLOUR[2] * shine
    return red, green, blue


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _irradiance(
    k: int, toward: float, fill: float, rim: float, upward: float, key: float, sky: float, soft: float, albedo: float
) -> float:
    """Light that arrives in channel k; creases are brightened by the light that their own walls send on.

    The wrapped cosine is flattened towards the shadow's edge, which a straight end would draw as a line. Of the key light a
    crease loses at most six tenths, since part of its sky is where the key light stands.
    """
    wrap = _WRAP[k] * soft
    wrapped = max(0.0, (toward + wrap) / (1.0 + wrap))
    wrapped *= (wrapped + 2.0 * wrap) / (1.0 + 2.0 * wrap) if soft > 0 else 1.0
    through = key * (1.0 + 1.6 * wrap * (1.0 - key))
    dimmed = sky * (1.0 + 0.6 * albedo * (1.0 - sky))
    direct = KEY_COLOUR[k] * wrapped * through * (0.4 + 0.6 * sky)
    return direct + FILL_COLOUR[k] * fill + RIM_COLOUR[k] * rim + (_GROUND[k] + (_SKY[k] - _GROUND[k]) * upward) * dimmed
