"""What light does on skin, eyes, teeth and tongue: one colour per pixel and surface.

All colours are linear RGB; lengths are mm.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from facesynth.face.draw.eye import eye_colour
from facesynth.face.draw.furrows import furrow
from facesynth.face.draw.light import reflect, smoothstep, unit
from facesynth.face.draw.raster import barycentric
from facesynth.face.draw.shadow import lit_share

SKIN, EYE, TEETH, TONGUE, HIDDEN = range(5)
"""Materials; HIDDEN surfaces (the lashes' cards) are not drawn."""
FURROW_DARK = 0.40
"""How much of the light the bottom of a furrow loses."""
OPEN_MM = 7.0
"""From this opening of the lips on the mouth is lit as if they were not there."""


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
    lost: NDArray[np.float32]
    """[N] how far skin is pushed together (`pushed_together`); none of it on heads whose furrows nobody drew."""


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
    nx, ny, nz = unit(n[0] + 0.45 * bend * abs(bend) * (1.0 if rest[0] > 0 else -1.0), n[1], n[2])
    between = smoothstep(0.82, 1.0, abs(bend))
    ivory = 1.0 - 0.55 * between
    gum = smoothstep(-80.3, -82.3, rest[1]) if lower else smoothstep(-62.8, -60.8, rest[1])
    red, green, blue = 0.66 * ivory, 0.60 * ivory * (1.0 - 0.05 * between), 0.50 * ivory * (1.0 - 0.12 * between)
    red, green, blue = red + (0.30 - red) * gum, green + (0.10 - green) * gum, blue + (0.09 - blue) * gum
    return reflect((red, green, blue), (nx, ny, nz), v, key, sky, 0.5, 0.28, 6, 0.0)


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _weigh(values: NDArray[Any], a: int, b: int, c: int, wb: float, wc: float) -> tuple[float, float, float]:
    wa = 1.0 - wb - wc
    return (
        wa * values[a, 0] + wb * values[b, 0] + wc * values[c, 0],
        wa * values[a, 1] + wb * values[b, 1] + wc * values[c, 1],
        wa * values[a, 2] + wb * values[b, 2] + wc * values[c, 2],
    )


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _darker(red: float, green: float, blue: float, left: float) -> tuple[float, float, float]:
    """A colour of skin of which a share of the light is left: red is lost least, as in all folds of skin."""
    return red * (0.4 + 0.6 * left), green * left, blue * left


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def shade(surface: Surface, shot: Shot, fragments: NDArray[Any], colours: NDArray[Any]) -> None:
    """Linear colours [>= K, 3] of K fragments (triangle, column, row), each seen at the middle of its pixel.

    The arrays are taken out of their tuples first: inside the loop each of them would be counted as
    one more reference, atomically, for every pixel.
    """
    quads, material, rest, texture = surface.quads, surface.material, surface.rest, surface.texture
    occlusion, cavity = surface.occlusion, surface.cavity
    screen, position, normal, shadow, light, eyes, camera, lost = (
        shot.screen,
        shot.position,
        shot.normal,
        shot.shadow,
        shot.light,
        shot.eyes,
        shot.camera,
        shot.lost,
    )
    mouth = 0.12 + 0.88 * smoothstep(0.0, OPEN_MM, shot.mouth_mm[0])
    for k in range(len(fragments)):
        quad, half = fragments[k, 0] >> 1, fragments[k, 0] & 1
        a, b, c = quads[quad, 0], quads[quad, 1 + half], quads[quad, 2 + half]
        wb, wc = barycentric(screen, a, b, c, np.float32(fragments[k, 1] + 0.5), np.float32(fragments[k, 2] + 0.5))
        p = _weigh(position, a, b, c, wb, wc)
        n = _weigh(normal, a, b, c, wb, wc)
        n = unit(n[0], n[1], n[2])
        v = unit(camera[0] - p[0], camera[1] - p[1], camera[2] - p[2])
        key = lit_share(shadow, light, p[0] + n[0], p[1] + n[1], p[2] + n[2])
        sky = (1.0 - wb - wc) * occlusion[a] + wb * occlusion[b] + wc * occlusion[c]
        reach = (1.0 - wb - wc) * cavity[a] + wb * cavity[b] + wc * cavity[c]
        if material[quad] == EYE:
            colour = eye_colour(p, v, eyes, 0 if rest[a, 0] > 0 else 1, key)
        elif material[quad] == SKIN:
            s, t = (wb + wc, wc) if half == 0 else (wb, wb + wc)
            red, green, blue, gloss = _texel(texture, quad, s, t)
            pushed = (1.0 - wb - wc) * lost[a] + wb * lost[b] + wc * lost[c]
            if pushed > 0.05:
                place = _weigh(rest, a, b, c, wb, wc)
                deep, slope_x, slope_y = furrow(place[0], place[1], place[2], pushed)
                n = unit(n[0] - slope_x, n[1] - slope_y, n[2])
                sky *= 1.0 - FURROW_DARK * deep
                red, green, blue = _darker(red, green, blue, 1.0 - FURROW_DARK * deep)
            colour = reflect((red, green, blue), n, v, key * reach, sky * reach, 1.0, gloss * reach, 5, sky * sky * reach)
        elif material[quad] == TEETH:
            colour = _teeth(_weigh(rest, a, b, c, wb, wc), n, v, key * reach * mouth, 0.75 * sky * reach * mouth)
        else:
            reach *= mouth
            colour = reflect((0.40, 0.125, 0.115), n, v, key * reach, sky * reach, 1.0, 0.35 * reach, 6, 0.0)
        colours[k, 0], colours[k, 1], colours[k, 2] = colour
