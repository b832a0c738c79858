"""Rasterising small triangles and hair on the processor: no driver, the same bytes every time.

A picture is cut into square tiles. Each tile knows the triangles and the hair segments that touch it,
has its own depth buffer of four samples per pixel, and depends on no other tile, so that any number of
threads gives the same result. The kernels release Python's lock.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

TILE = 32
"""Pixels along a tile's side."""
SAMPLES = 4
FAR = np.float32(1e30)

# A rotated grid: no two samples share a row or a column, so nearly level and nearly upright edges get all four steps.
_SAMPLE_X = np.array([-0.125, 0.375, -0.375, 0.125], np.float32)
_SAMPLE_Y = np.array([-0.375, -0.125, 0.125, 0.375], np.float32)


@njit(cache=True, nogil=True, error_model="numpy")
def vertex_normals(points: NDArray[Any], quads: NDArray[Any]) -> NDArray[Any]:
    """[N, 3] unit normals of points [N, 3]: the cross products of the diagonals of the quads around, added up."""
    normals = np.zeros_like(points)
    for q in range(len(quads)):
        a, b, c, d = quads[q, 0], quads[q, 1], quads[q, 2], quads[q, 3]
        ux, uy, uz = points[c, 0] - points[a, 0], points[c, 1] - points[a, 1], points[c, 2] - points[a, 2]
        vx, vy, vz = points[d, 0] - points[b, 0], points[d, 1] - points[b, 1], points[d, 2] - points[b, 2]
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        for k in range(4):
            i = quads[q, k]
            normals[i, 0] += nx
            normals[i, 1] += ny
            normals[i, 2] += nz
    for i in range(len(normals)):
        x, y, z = normals[i, 0], normals[i, 1], normals[i, 2]
        scale = np.float32(1.0) / max(np.sqrt(x * x + y * y + z * z), np.float32(1e-12))
        normals[i, 0] = x * scale
        normals[i, 1] = y * scale
        normals[i, 2] = z * scale
    return normals


@njit(cache=True, nogil=True, error_model="numpy")
def project(points: NDArray[Any], axes: NDArray[Any], middle_px: NDArray[Any], focal_px: float) -> NDArray[np.float32]:
    """[N, 3] column and row in pixels and depth in mm of points [N, 3], seen along axes [4, 3] (the last is the place)."""
    screen = np.empty((len(points), 3), np.float32)
    for i in range(len(points)):
        x, y, z = points[i, 0] - axes[3, 0], points[i, 1] - axes[3, 1], points[i, 2] - axes[3, 2]
        depth = x * axes[2, 0] + y * axes[2, 1] + z * axes[2, 2]
        screen[i, 0] = middle_px[0] + focal_px * (x * axes[0, 0] + y * axes[0, 1] + z * axes[0, 2]) / depth
        screen[i, 1] = middle_px[1] + focal_px * (x * axes[1, 0] + y * axes[1, 1] + z * axes[1, 2]) / depth
        screen[i, 2] = depth
    return screen


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def draw_depth(screen: NDArray[Any], quads: NDArray[Any], depth: NDArray[Any]) -> None:
    """Keep in depth [H, W] the smallest z of quads over screen points [N, 3] (x, y in pixels, z), both sides drawn."""
    height, width = depth.shape
    for q in range(len(quads)):
        for half in range(2):
            a, b, c = quads[q, 0], quads[q, 1 + half], quads[q, 2 + half]
            ax, ay, az = screen[a, 0], screen[a, 1], screen[a, 2]
            bx, by, bz = screen[b, 0], screen[b, 1], screen[b, 2]
            cx, cy, cz = screen[c, 0], screen[c, 1], screen[c, 2]
            area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
            if area == 0:
                continue
            x0, x1 = max(0, int(np.ceil(min(ax, bx, cx) - 0.5))), min(width - 1, int(np.floor(max(ax, bx, cx) - 0.5)))
            y0, y1 = max(0, int(np.ceil(min(ay, by, cy) - 0.5))), min(height - 1, int(np.floor(max(ay, by, cy) - 0.5)))
            inverse = np.float32(1.0) / area
            wb_x, wb_y = (cy - ay) * inverse, -(cx - ax) * inverse
            wc_x, wc_y = -(by - ay) * inverse, (bx - ax) * inverse
            for y in range(y0, y1 + 1):
                py = np.float32(y) + np.float32(0.5) - ay
                for x in range(x0, x1 + 1):
                    px = np.float32(x) + np.float32(0.5) - ax
                    wb, wc = px * wb_x + py * wb_y, px * wc_x + py * wc_y
                    if wb >= 0 and wc >= 0 and wb + wc <= 1:
                        depth[y, x] = min(depth[y, x], az + wb * (bz - az) + wc * (cz - az))


@njit(cache=True, nogil=True, error_model="numpy")
def bin_triangles(
    screen: NDArray[Any], quads: NDArray[Any], columns: int, rows: int
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Which front-facing triangles touch which tile: starts [rows * columns + 1] into a list of triangles.

    Triangle 2 q is corners 0, 1, 2 of quad q; triangle 2 q + 1 is corners 0, 2, 3.
    """
    starts = np.zeros(rows * columns + 1, np.int32)
    spans = np.empty((2 * len(quads), 4), np.int16)
    for t in range(2 * len(quads)):
        a, b, c = quads[t >> 1, 0], quads[t >> 1, 1 + (t & 1)], quads[t >> 1, 2 + (t & 1)]
        ax, ay, bx, by, cx, cy = screen[a, 0], screen[a, 1], screen[b, 0], screen[b, 1], screen[c, 0], screen[c, 1]
        spans[t, 1] = -1
        if (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) >= 0:  # y runs down: seen from outside, corners turn the other way
            continue
        x0, x1 = int(np.floor(min(ax, bx, cx) / TILE)), int(np.floor(max(ax, bx, cx) / TILE))
        y0, y1 = int(np.floor(min(ay, by, cy) / TILE)), int(np.floor(max(ay, by, cy) / TILE))
        x0, x1, y0, y1 = max(x0, 0), min(x1, columns - 1), max(y0, 0), min(y1, rows - 1)
        if x1 < x0 or y1 < y0:
            continue
        spans[t, 0], spans[t, 1], spans[t, 2], spans[t, 3] = x0, x1, y0, y1
        for y in range(y0, y1 + 1):
            for x in range(x0, x1 + 1):
                starts[y * columns + x + 1] += 1
    starts = np.cumsum(starts).astype(np.int32)
    return starts, _filled(spans, starts, columns)


@njit(cache=True, nogil=True, error_model="numpy")
def bin_segments(
    screen: NDArray[Any], segments: NDArray[Any], order: NDArray[Any], reach_px: float, columns: int, rows: int
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Like `bin_triangles` for line segments [M, 2]; each tile's list keeps the order given (nearest first)."""
    starts = np.zeros(rows * columns + 1, np.int32)
    spans = np.empty((len(order), 4), np.int16)
    for k in range(len(order)):
        a, b = segments[order[k], 0], segments[order[k], 1]
        ax, ay, bx, by = screen[a, 0], screen[a, 1], screen[b, 0], screen[b, 1]
        x0, x1 = int(np.floor((min(ax, bx) - reach_px) / TILE)), int(np.floor((max(ax, bx) + reach_px) / TILE))
        y0, y1 = int(np.floor((min(ay, by) - reach_px) / TILE)), int(np.floor((max(ay, by) + reach_px) / TILE))
        x0, x1, y0, y1 = max(x0, 0), min(x1, columns - 1), max(y0, 0), min(y1, rows - 1)
        spans[k, 1] = -1
        if x1 < x0 or y1 < y0:
            continue
        spans[k, 0], spans[k, 1], spans[k, 2], spans[k, 3] = x0, x1, y0, y1
        for y in range(y0, y1 + 1):
            for x in range(x0, x1 + 1):
                starts[y * columns + x + 1] += 1
    starts = np.cumsum(starts).astype(np.int32)
    filled = _filled(spans, starts, columns)
    for k in range(len(filled)):
        filled[k] = order[filled[k]]
    return starts, filled


@njit(cache=True, nogil=True, error_model="numpy")
def _filled(spans: NDArray[Any], starts: NDArray[Any], columns: int) -> NDArray[np.int32]:
    members = np.empty(starts[-1], np.int32)
    cursor = starts[:-1].copy()
    for t in range(len(spans)):
        if spans[t, 1] < 0:
            continue
        for y in range(spans[t, 2], spans[t, 3] + 1):
            for x in range(spans[t, 0], spans[t, 1] + 1):
                tile = y * columns + x
                members[cursor[tile]] = t
                cursor[tile] += 1
    return members


@njit(cache=True, nogil=True, error_model="numpy")
def nearest_first(screen: NDArray[Any], segments: NDArray[Any], facing: NDArray[Any], buckets: int) -> NDArray[np.int32]:
    """Segments whose roots do not face away (facing [N] > 0), by rising depth: a counting sort into depth buckets."""
    low, high = FAR, -FAR
    for m in range(len(segments)):
        z = screen[segments[m, 0], 2]
        low, high = min(low, z), max(high, z)
    scale = (buckets - 1) / max(high - low, np.float32(1e-6))
    counts = np.zeros(buckets + 1, np.int32)
    for m in range(len(segments)):
        if facing[segments[m, 0]] > 0:
            counts[int((screen[segments[m, 0], 2] - low) * scale) + 1] += 1
    counts = np.cumsum(counts).astype(np.int32)
    order = np.empty(counts[-1], np.int32)
    for m in range(len(segments)):
        if facing[segments[m, 0]] > 0:
            bucket = int((screen[segments[m, 0], 2] - low) * scale)
            order[counts[bucket]] = m
            counts[bucket] += 1
    return order


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def draw_triangle(
    screen: NDArray[Any], quads: NDArray[Any], triangle: int, left: int, top: int, depth: NDArray[Any], owner: NDArray[Any]
) -> None:
    """Draw one triangle into a tile: depth and owner [TILE, TILE, SAMPLES], whose corner is pixel (left, top).

    Samples on an edge belong to both neighbours; the nearer, or the one drawn first, wins. No gaps can open.

    The weights wb and wc of corners b and c are affine in the place on the screen, so they are worked out once for a pixel's
    middle and shifted for its samples. These lie at most 0.375 px from the middle in x and in y: a pixel whose weights are
    further outside than that can change is passed over whole.
    """
    quad, half = triangle >> 1, triangle & 1
    a, b, c = quads[quad, 0], quads[quad, 1 + half], quads[quad, 2 + half]
    ax, ay, az = screen[a, 0] - left, screen[a, 1] - top, screen[a, 2]
    bx, by, bz = screen[b, 0] - left, screen[b, 1] - top, screen[b, 2]
    cx, cy, cz = screen[c, 0] - left, screen[c, 1] - top, screen[c, 2]
    inverse = np.float32(1.0) / ((bx - ax) * (cy - ay) - (by - ay) * (cx - ax))
    wb_x, wb_y = (cy - ay) * inverse, -(cx - ax) * inverse
    wc_x, wc_y = -(by - ay) * inverse, (bx - ax) * inverse
    zb, zc = bz - az, cz - az
    x0, x1 = max(0, int(np.floor(min(ax, bx, cx)))), min(TILE - 1, int(np.floor(max(ax, bx, cx))))
    y0, y1 = max(0, int(np.floor(min(ay, by, cy)))), min(TILE - 1, int(np.floor(max(ay, by, cy))))
    slack, middle = np.float32(-1e-5), np.float32(0.5)
    spread_b, spread_c = np.float32(0.375) * (abs(wb_x) + abs(wb_y)), np.float32(0.375) * (abs(wc_x) + abs(wc_y))
    for y in range(y0, y1 + 1):
        py = np.float32(y) + middle - ay
        for x in range(x0, x1 + 1):
            px = np.float32(x) + middle - ax
            middle_b, middle_c = px * wb_x + py * wb_y, px * wc_x + py * wc_y
            if middle_b < -spread_b or middle_c < -spread_c or middle_b + middle_c > np.float32(1.0) + spread_b + spread_c:
                continue
            for s in range(SAMPLES):
                wb = middle_b + _SAMPLE_X[s] * wb_x + _SAMPLE_Y[s] * wb_y
                wc = middle_c + _SAMPLE_X[s] * wc_x + _SAMPLE_Y[s] * wc_y
                if wb >= slack and wc >= slack and wb + wc <= np.float32(1.0) - slack:
                    z = az + wb * zb + wc * zc
                    if z < depth[y, x, s]:
                        depth[y, x, s] = z
                        owner[y, x, s] = triangle


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def barycentric(
    screen: NDArray[Any], a: int, b: int, c: int, x: float | np.float32, y: float | np.float32
) -> tuple[float, float]:
    """Weights of corners b and c of a triangle at screen point (x, y); that of a is the rest of 1.

    Measured on the screen: over triangles of a few millimetres, a metre away, perspective bends nothing.
    """
    ax, ay = screen[a, 0], screen[a, 1]
    ux, uy, vx, vy = screen[b, 0] - ax, screen[b, 1] - ay, screen[c, 0] - ax, screen[c, 1] - ay
    inverse = np.float32(1.0) / min(ux * vy - uy * vx, np.float32(-1e-9))  # front-facing: negative, for y runs down
    wb = ((x - ax) * vy - (y - ay) * vx) * inverse
    wc = ((y - ay) * ux - (x - ax) * uy) * inverse
    return min(max(wb, np.float32(0)), np.float32(1)), min(max(wc, np.float32(0)), np.float32(1))


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
def draw_segment(
    screen: NDArray[Any],
    width_px: NDArray[Any],
    colour: NDArray[Any],
    a: int,
    b: int,
    left: int,
    top: int,
    depth: NDArray[Any],
    gathered: NDArray[Any],
) -> None:
    """Lay one piece of hair behind what a tile has gathered [TILE, TILE, 4] so far: colour and what still shines through.

    Hair thinner than a pixel covers its width's share of it. Segments must come nearest first; a pixel
    lies on a segment where its foot falls between the ends, so that joints are not counted twice.
    """
    ax, ay, bx, by = screen[a, 0] - left, screen[a, 1] - top, screen[b, 0] - left, screen[b, 1] - top
    dx, dy = bx - ax, by - ay
    length = np.sqrt(dx * dx + dy * dy)
    if length < np.float32(1e-3):
        return
    dx, dy = dx / length, dy / length
    steep = abs(dy) > abs(dx)
    widest = max(width_px[a], width_px[b])
    reach = (max(widest, np.float32(1.0)) * np.float32(0.5) + np.float32(0.5)) / max(abs(dx), abs(dy))
    first, last = (min(ay, by), max(ay, by)) if steep else (min(ax, bx), max(ax, bx))
    pad = np.float32(0.5) * widest + np.float32(0.5)
    for major in range(max(0, int(np.floor(first - pad))), min(TILE - 1, int(np.floor(last + pad))) + 1):
        middle = (ax + (major + np.float32(0.5) - ay) * dx / dy) if steep else (ay + (major + np.float32(0.5) - ax) * dy / dx)
        for minor in range(max(0, int(np.floor(middle - reach))), min(TILE - 1, int(np.floor(middle + reach))) + 1):
            x, y = (minor, major) if steep else (major, minor)
            through = gathered[y, x, 3]
            if through < np.float32(0.04):
                continue
            px, py = x + np.float32(0.5) - ax, y + np.float32(0.5) - ay
            along = (px * dx + py * dy) / length
            if along < 0 or along >= 1:
                continue
            wide = width_px[a] + along * (width_px[b] - width_px[a])
            drawn = max(wide, np.float32(1.0))
            cover = (drawn * np.float32(0.5) + np.float32(0.5) - abs(px * dy - py * dx)) * wide / drawn
            if cover <= 0:
                continue
            z = screen[a, 2] + along * (screen[b, 2] - screen[a, 2])
            seen = np.float32(0)
            for s in range(SAMPLES):
                seen += np.float32(1.0 / SAMPLES) if z < depth[y, x, s] else np.float32(0)
            share = min(cover, np.float32(1)) * seen * through
            for k in range(3):
                gathered[y, x, k] += share * (colour[a, k] + along * (colour[b, k] - colour[a, k]))
            gathered[y, x, 3] = through - share
