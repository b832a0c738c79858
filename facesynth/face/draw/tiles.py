"""From triangles and strands to pixels, one tile after the other."""

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from facesynth.face.draw.light import BACK, FILL, KEY, KEY_COLOUR, RIM, RIM_COLOUR, smoothstep
from facesynth.face.draw.raster import FAR, SAMPLES, TILE, draw_segment, draw_triangle
from facesynth.face.draw.shading import Shot, Surface, shade


class Hair(NamedTuple):
    """Strands of one frame: P points, M segments."""

    screen: NDArray[np.float32]
    """[P, 3] column, row, depth."""
    width_px: NDArray[np.float32]
    """[P]"""
    colour: NDArray[np.float32]
    """[P, 3] lit, linear."""
    segments: NDArray[np.int32]
    """[M, 2]"""


NO_HAIR = Hair(np.zeros((0, 3), np.float32), np.zeros(0, np.float32), np.zeros((0, 3), np.float32), np.zeros((0, 2), np.int32))


class Bins(NamedTuple):
    """What touches each tile: triangles, and segments nearest first."""

    triangle_starts: NDArray[np.int32]
    triangles: NDArray[np.int32]
    segment_starts: NDArray[np.int32]
    segments: NDArray[np.int32]


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def light_hair(
    points: NDArray[Any], normals: NDArray[Any], segments: NDArray[Any], albedo: NDArray[Any], camera: NDArray[Any]
) -> NDArray[np.float32]:
    """[P, 3] colour of strands: cylinders that scatter most light across their tangent (Kajiya and Kay 1989).

    Diffuse light is the sine between tangent and light; the highlight falls with the angle between the
    light's and the view's cones. The normal of the ground under a root tells how much light gets there.
    """
    colour = np.zeros((len(points), 3), np.float32)
    for m in range(len(segments)):
        a, b = segments[m, 0], segments[m, 1]
        tx, ty, tz = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1], points[b, 2] - points[a, 2]
        scale = 1.0 / np.sqrt(tx * tx + ty * ty + tz * tz + 1e-9)
        tx, ty, tz = tx * scale, ty * scale, tz * scale
        vx, vy, vz = camera[0] - points[a, 0], camera[1] - points[a, 1], camera[2] - points[a, 2]
        scale = 1.0 / np.sqrt(vx * vx + vy * vy + vz * vz)
        tv = (tx * vx + ty * vy + tz * vz) * scale
        sv = np.sqrt(max(0.0, 1.0 - tv * tv))
        nx, ny, nz = normals[a, 0], normals[a, 1], normals[a, 2]
        tk = tx * KEY[0] + ty * KEY[1] + tz * KEY[2]
        sk = np.sqrt(max(0.0, 1.0 - tk * tk))
        reached = smoothstep(-0.25, 0.75, nx * KEY[0] + ny * KEY[1] + nz * KEY[2])
        shine = max(0.0, sk * sv - tk * tv)
        glow = max(0.0, nx * RIM[0] + ny * RIM[1] + nz * RIM[2]) + 0.8 * max(0.0, nx * BACK[0] + ny * BACK[1] + nz * BACK[2])
        fill = max(0.0, 0.3 + nx * FILL[0] + ny * FILL[1] + nz * FILL[2])
        for k in range(3):
            diffuse = KEY_COLOUR[k] * reached * (0.25 + 0.75 * sk) + 0.30 * fill + 0.42 + 0.9 * RIM_COLOUR[k] * glow
            bright = KEY_COLOUR[k] * reached * (0.045 * shine**60 + 1.1 * albedo[a, k] * shine**14)
            colour[a, k] = albedo[a, k] * diffuse + bright + 0.02 * RIM_COLOUR[k] * glow
            colour[b, k] = colour[a, k] * albedo[b, k] / max(albedo[a, k], np.float32(1e-6))
    return colour


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def draw_tiles(
    tiles: NDArray[Any],
    surface: Surface,
    shot: Shot,
    hair: Hair,
    bins: Bins,
    backdrop: NDArray[Any],
    curve: NDArray[Any],
    picture: NDArray[Any],
) -> None:
    """Fill the given tiles of picture [H, W, 3]; backdrop [H, W, 3] is linear, curve maps 0..4 linear to 0..255."""
    width = picture.shape[1]
    across = (width + TILE - 1) // TILE
    depth = np.empty((TILE, TILE, SAMPLES), np.float32)
    owner = np.empty((TILE, TILE, SAMPLES), np.int32)
    gathered = np.empty((TILE, TILE, 4), np.float32)
    fragments = np.empty((TILE * TILE * SAMPLES, 3), np.int32)
    shares = np.empty(TILE * TILE * SAMPLES, np.float32)
    colours = np.empty((TILE * TILE * SAMPLES, 3), np.float32)
    for tile in tiles:
        left, top = (tile % across) * TILE, (tile // across) * TILE
        depth[:] = FAR
        owner[:] = -1
        gathered[:, :, :3] = 0
        gathered[:, :, 3] = 1
        for k in range(bins.triangle_starts[tile], bins.triangle_starts[tile + 1]):
            draw_triangle(shot.screen, surface.quads, bins.triangles[k], left, top, depth, owner)
        for k in range(bins.segment_starts[tile], bins.segment_starts[tile + 1]):
            a, b = hair.segments[bins.segments[k], 0], hair.segments[bins.segments[k], 1]
            draw_segment(hair.screen, hair.width_px, hair.colour, a, b, left, top, depth, gathered)
        count = _collect(surface.quads, surface.material, shot.normal, depth, owner, gathered, left, top, fragments, shares)
        shade(surface, shot, fragments[:count], colours)
        _lay_under(gathered, fragments[:count], shares, colours, left, top)
        _develop(gathered, backdrop, curve, left, top, picture)


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _collect(
    quads: NDArray[Any],
    material: NDArray[Any],
    normal: NDArray[Any],
    depth: NDArray[Any],
    owner: NDArray[Any],
    gathered: NDArray[Any],
    left: int,
    top: int,
    fragments: NDArray[Any],
    shares: NDArray[Any],
) -> int:
    """List the surfaces of each pixel (triangle, column, row) with their share of what the hair lets through.

    Samples of one material that lie within 3 mm and face alike are one surface, shaded once at the pixel's
    middle; lips that touch face each other and stay two.
    """
    count = 0
    for y in range(TILE):
        for x in range(TILE):
            through = gathered[y, x, 3]
            waiting = (1 << SAMPLES) - 1 if through > np.float32(0.04) else 0
            for s in range(SAMPLES):
                first = owner[y, x, s]
                if first < 0 or not waiting & (1 << s):
                    continue
                share = np.float32(0)
                for k in range(s, SAMPLES):
                    other = owner[y, x, k]
                    if other < 0 or not waiting & (1 << k):
                        continue
                    near = abs(depth[y, x, k] - depth[y, x, s]) < np.float32(3.0)
                    if other == first or (near and _alike(quads, material, normal, first >> 1, other >> 1)):
                        share += through / np.float32(SAMPLES)
                        waiting &= ~(1 << k)
                fragments[count, 0], fragments[count, 1], fragments[count, 2] = first, left + x, top + y
                shares[count] = share
                gathered[y, x, 3] -= share
                count += 1
    return count


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _alike(quads: NDArray[Any], material: NDArray[Any], normal: NDArray[Any], one: int, other: int) -> bool:
    a, b = quads[one, 0], quads[other, 0]
    cosine = normal[a, 0] * normal[b, 0] + normal[a, 1] * normal[b, 1] + normal[a, 2] * normal[b, 2]
    return material[one] == material[other] and cosine > np.float32(0.7)


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _lay_under(
    gathered: NDArray[Any], fragments: NDArray[Any], shares: NDArray[Any], colours: NDArray[Any], left: int, top: int
) -> None:
    for k in range(len(fragments)):
        x, y = fragments[k, 1] - left, fragments[k, 2] - top
        for channel in range(3):
            gathered[y, x, channel] += shares[k] * colours[k, channel]


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def _develop(
    gathered: NDArray[Any], backdrop: NDArray[Any], curve: NDArray[Any], left: int, top: int, picture: NDArray[Any]
) -> None:
    height, width = picture.shape[:2]
    scale = np.float32(len(curve) / 4.0)
    for y in range(min(TILE, height - top)):
        for x in range(min(TILE, width - left)):
            through = gathered[y, x, 3]
            for channel in range(3):
                value = gathered[y, x, channel] + through * backdrop[top + y, left + x, channel]
                picture[top + y, left + x, channel] = curve[min(max(int(value * scale), 0), len(curve) - 1)]
