"""What light does on skin, eyes, teeth and tongue: one colour per pixel and surface, in linear light.

A key light from the upper left of the picture with a soft shadow, a cool fill from the right, two rims
from behind, and a sky dimmed by baked occlusion. All colours are linear RGB; lengths are mm.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from facesynth.face.draw.raster import barycentric

SKIN, EYE, TEETH, TONGUE, HIDDEN = range(5)
"""Materials; HIDDEN surfaces (the lashes' cards) are not drawn."""

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
REACH = 2
"""Texels of the shadow map that are looked at to each side of a point."""
OPEN_MM = 7.0
"""From this opening of the lips on the mouth is lit as if they were not there."""
_RAMP_MM = 4.0  # an occluder that far in front shades fully


class Surface(NamedTuple):
    """What stays the same from frame to frame. N fine vertices, F fine quads: skin first, hidden ones last."""

    quads: NDArray[np.int32]
    """[F, 4]"""
    material: NDArray[np.uint8]
    """[F]"""
    rest: NDArray[np.float32]
    """[N, 3] rest pose, mm."""
    occlusion: NDArray[np.float32]
    """[N] share of the sky that is seen, 0..1."""
    cavity: NDArray[np.float32]
    """[N] how far light reaches into the mouth: 1 outside."""
    texture: NDArray[np.uint8]
    """[skin quads, TEXELS, TEXELS, 4] square root of the albedo, and gloss; texels lie on the corners and edges."""


class Shot(NamedTuple):
    """One frame: screen points (x, y in pixels, depth in mm), positions and normals [N, 3]."""

    screen: NDArray[np.float32]
    position: NDArray[np.float32]
    normal: NDArray[np.float32]
    shadow: NDArray[np.float32]
    """[S, S, 3] shadow map: depth, and the nearest and farthest depth around."""
    light: NDArray[np.float32]
    """[3, 4] world to shadow map: column, row, depth."""
    eyes: NDArray[np.float32]
    """[2, 4, 3] left and right: three rows that turn the world into the eye's axes, then the eye's centre."""
    camera: NDArray[np.float32]
    """[3] position of the camera."""
    mouth_mm: NDArray[np.float32]
    """[1] opening of the lips: no light comes in between closed ones."""


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def smoothstep(low: float, high: float, x: float) -> float:
    """0 below low, 1 above high, smooth between."""
    t = min(max((x - low) / (high - low), 0.0), 1.0)
    return t * t * (3.0 - 2.0 * t)


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


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _texel(texture: NDArray[Any], quad: int, s: float, t: float) -> tuple[float, float, float, float]:
    """Bilinear look-up in the patch of a quad: linear albedo (decoded from its square root) and gloss."""
    top = texture.shape[1] - 1
    u, v = s * top, t * top
    i, j = min(int(u), top - 1), min(int(v), top - 1)
    u, v = u - i, v - j
    red, green, blue, gloss = 0.0, 0.0, 0.0, 0.0
    for k in range(4):
        m, n = i + (k & 1), j + (k >> 1)
        share = (u if k & 1 else 1 - u) * (v if k >> 1 else 1 - v) / 255.0
        red += share * texture[quad, m, n, 0]
        green += share * texture[quad, m, n, 1]
        blue += share * texture[quad, m, n, 2]
        gloss += share * texture[quad, m, n, 3]
    return red * red, green * green, blue * blue, gloss


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _unit(x: float, y: float, z: float) -> tuple[float, float, float]:
    scale = 1.0 / np.sqrt(x * x + y * y + z * z + 1e-12)
    return x * scale, y * scale, z * scale


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _lobes(n: tuple[float, float, float], v: tuple[float, float, float], light: NDArray[Any], doublings: int) -> float:
    """Blinn and Phong's highlights with exponents 2 ** doublings and a quarter of it.

    Each is normalised, so that a narrow one carries as much light as a wide one.
    """
    hx, hy, hz = _unit(light[0] + v[0], light[1] + v[1], light[2] + v[2])
    value = max(n[0] * hx + n[1] * hy + n[2] * hz, 0.0)
    for _ in range(doublings - 2):
        value *= value
    narrow = value * value
    narrow *= narrow
    return (narrow * ((1 << doublings) + 8) + 0.55 * value * ((1 << (doublings - 2)) + 8)) / 25.0


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _reflect(
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
    toward = n[0] * KEY[0] + n[1] * KEY[1] + n[2] * KEY[2]
    fill = max(0.0, (n[0] * FILL[0] + n[1] * FILL[1] + n[2] * FILL[2] + 0.25) / 1.25) * sky
    rim = max(0.0, n[0] * RIM[0] + n[1] * RIM[1] + n[2] * RIM[2]) + 0.7 * max(
        0.0, n[0] * BACK[0] + n[1] * BACK[1] + n[2] * BACK[2]
    )
    rim *= rims
    grazing = 1.0 - max(0.0, n[0] * v[0] + n[1] * v[1] + n[2] * v[2])
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


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _eye(
    p: tuple[float, float, float], v: tuple[float, float, float], eyes: NDArray[Any], which: int, key: float
) -> tuple[float, float, float]:
    """An eyeball of radius 14.5 mm with a cornea of radius 7.8 mm in front of a flat iris.

    The ray is refracted at the cornea and met with the plane of the iris, so that the iris lies behind
    its window; the sclera darkens under the lids and towards the corners. Lengths are this mesh's: the cornea's centre lies
    9.5 mm in front of the eye's, so the two spheres meet 7.2 mm off the axis; the window fades within, from 5.4 to 6.6 mm.
    """
    dx, dy, dz = p[0] - eyes[which, 3, 0], p[1] - eyes[which, 3, 1], p[2] - eyes[which, 3, 2]
    ex = eyes[which, 0, 0] * dx + eyes[which, 0, 1] * dy + eyes[which, 0, 2] * dz
    ey = eyes[which, 1, 0] * dx + eyes[which, 1, 1] * dy + eyes[which, 1, 2] * dz
    ez = eyes[which, 2, 0] * dx + eyes[which, 2, 1] * dy + eyes[which, 2, 2] * dz
    vx = eyes[which, 0, 0] * v[0] + eyes[which, 0, 1] * v[1] + eyes[which, 0, 2] * v[2]
    vy = eyes[which, 1, 0] * v[0] + eyes[which, 1, 1] * v[1] + eyes[which, 1, 2] * v[2]
    vz = eyes[which, 2, 0] * v[0] + eyes[which, 2, 1] * v[1] + eyes[which, 2, 2] * v[2]
    ux, uy, uz = _unit(ex, ey, ez)
    cx, cy, cz = _unit(ex, ey, ez - 9.5)
    window = (1.0 - smoothstep(5.4, 6.6, 14.5 * np.sqrt(ux * ux + uy * uy))) if uz > 0 else 0.0
    nx, ny, nz = _unit(ux + (cx - ux) * window, uy + (cy - uy) * window, uz + (cz - uz) * window)
    wx = eyes[which, 0, 0] * nx + eyes[which, 1, 0] * ny + eyes[which, 2, 0] * nz
    wy = eyes[which, 0, 1] * nx + eyes[which, 1, 1] * ny + eyes[which, 2, 1] * nz
    wz = eyes[which, 0, 2] * nx + eyes[which, 1, 2] * ny + eyes[which, 2, 2] * nz
    side = smoothstep(7.0, 13.0, abs(dx))
    shade = (1.0 - 0.62 * smoothstep(0.5, 5.5, dy)) * (1.0 - 0.35 * smoothstep(-3.0, -7.0, dy)) * (1.0 - 0.35 * side)
    white = (0.60, 0.555 - 0.10 * side, 0.52 - 0.11 * side)
    red, green, blue = _reflect(white, (wx, wy, wz), v, (0.35 + 0.65 * key) * shade, shade, 0.6, 0.0, 5, 0.3 * shade)
    if window > 0:
        ired, igreen, iblue = _iris((ex, ey, ez), (cx, cy, cz), (vx, vy, vz), eyes, which, key)
        red += (ired * shade - red) * window
        green += (igreen * shade - green) * window
        blue += (iblue * shade - blue) * window
    return _with_tears(red, green, blue, (wx, wy, wz), v, shade, window)


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
    lx = eyes[which, 0, 0] * KEY[0] + eyes[which, 0, 1] * KEY[1] + eyes[which, 0, 2] * KEY[2]
    ly = eyes[which, 1, 0] * KEY[0] + eyes[which, 1, 1] * KEY[1] + eyes[which, 1, 2] * KEY[2]
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


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _teeth(
    rest: tuple[float, float, float], n: tuple[float, float, float], v: tuple[float, float, float], key: float, sky: float
) -> tuple[float, float, float]:
    """Two arches of teeth with gums: dark lines between neighbours, each tooth rounded by bending its normal.

    The mesh has smooth bands for teeth. The middle and half the width of each tooth (incisors, canine, the rest), the height
    at which the arches meet (-71.7 mm) and the lines of the gums are measured on it, at rest.
    """
    lower = rest[1] < -71.7
    across = abs(rest[0])
    centre, half = 4.2, 4.2
    if lower:
        centre, half = (
            (2.7, 2.7) if across < 5.4 else ((8.3, 2.9) if across < 11.2 else ((14.5, 3.3) if across < 17.8 else (21.0, 3.2)))
        )
    else:
        centre, half = (
            (4.2, 4.2) if across < 8.4 else ((11.7, 3.3) if across < 15.0 else ((18.5, 3.5) if across < 22.0 else (25.0, 3.0)))
        )
    bend = min(max((across - centre) / half, -1.0), 1.0)
    nx, ny, nz = _unit(n[0] + 0.45 * bend * abs(bend) * (1.0 if rest[0] > 0 else -1.0), n[1], n[2])
    between = smoothstep(0.82, 1.0, abs(bend))
    ivory = 1.0 - 0.55 * between
    gum = smoothstep(-80.3, -82.3, rest[1]) if lower else smoothstep(-62.8, -60.8, rest[1])
    red, green, blue = 0.66 * ivory, 0.60 * ivory * (1.0 - 0.05 * between), 0.50 * ivory * (1.0 - 0.12 * between)
    red, green, blue = red + (0.30 - red) * gum, green + (0.10 - green) * gum, blue + (0.09 - blue) * gum
    return _reflect((red, green, blue), (nx, ny, nz), v, key, sky, 0.5, 0.28, 6, 0.0)


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _weigh(values: NDArray[Any], a: int, b: int, c: int, wb: float, wc: float) -> tuple[float, float, float]:
    wa = 1.0 - wb - wc
    return (
        wa * values[a, 0] + wb * values[b, 0] + wc * values[c, 0],
        wa * values[a, 1] + wb * values[b, 1] + wc * values[c, 1],
        wa * values[a, 2] + wb * values[b, 2] + wc * values[c, 2],
    )


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def shade(surface: Surface, shot: Shot, fragments: NDArray[Any], colours: NDArray[Any]) -> None:
    """Linear colours [>= K, 3] of K fragments (triangle, column, row), each seen at the middle of its pixel.

    The arrays are taken out of their tuples first: inside the loop each of them would be counted as
    one more reference, atomically, for every pixel.
    """
    quads, material, rest, texture = surface.quads, surface.material, surface.rest, surface.texture
    occlusion, cavity = surface.occlusion, surface.cavity
    screen, position, normal, shadow, light, eyes, camera = (
        shot.screen,
        shot.position,
        shot.normal,
        shot.shadow,
        shot.light,
        shot.eyes,
        shot.camera,
    )
    mouth = 0.12 + 0.88 * smoothstep(0.0, OPEN_MM, shot.mouth_mm[0])
    for k in range(len(fragments)):
        quad, half = fragments[k, 0] >> 1, fragments[k, 0] & 1
        a, b, c = quads[quad, 0], quads[quad, 1 + half], quads[quad, 2 + half]
        wb, wc = barycentric(screen, a, b, c, np.float32(fragments[k, 1] + 0.5), np.float32(fragments[k, 2] + 0.5))
        p = _weigh(position, a, b, c, wb, wc)
        n = _weigh(normal, a, b, c, wb, wc)
        n = _unit(n[0], n[1], n[2])
        v = _unit(camera[0] - p[0], camera[1] - p[1], camera[2] - p[2])
        key = lit_share(shadow, light, p[0] + n[0], p[1] + n[1], p[2] + n[2])
        sky = (1.0 - wb - wc) * occlusion[a] + wb * occlusion[b] + wc * occlusion[c]
        reach = (1.0 - wb - wc) * cavity[a] + wb * cavity[b] + wc * cavity[c]
        if material[quad] == EYE:
            colour = _eye(p, v, eyes, 0 if rest[a, 0] > 0 else 1, key)
        elif material[quad] == SKIN:
            s, t = (wb + wc, wc) if half == 0 else (wb, wb + wc)
            red, green, blue, gloss = _texel(texture, quad, s, t)
            colour = _reflect((red, green, blue), n, v, key * reach, sky * reach, 1.0, gloss * reach, 5, sky * sky * reach)
        elif material[quad] == TEETH:
            colour = _teeth(_weigh(rest, a, b, c, wb, wc), n, v, key * reach * mouth, 0.75 * sky * reach * mouth)
        else:
            reach *= mouth
            colour = _reflect((0.40, 0.125, 0.115), n, v, key * reach, sky * reach, 1.0, 0.35 * reach, 6, 0.0)
        colours[k, 0], colours[k, 1], colours[k, 2] = colour
