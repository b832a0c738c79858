"""How much of the sky each point of a mesh sees: ambient occlusion from depth maps of many directions."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.face.draw.raster import FAR, draw_depth


def sky_directions(count: int) -> NDArray[np.float64]:
    """[count, 3] unit vectors spread evenly over the sphere (a Fibonacci lattice)."""
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    height = 1 - (2 * np.arange(count) + 1) / count
    flat = np.sqrt(1 - height**2)
    return np.stack([flat * np.cos(turn), height, flat * np.sin(turn)], axis=1)


def orthographic(direction: NDArray[np.float64], centre_mm: NDArray[Any], half_mm: float, size: int) -> NDArray[np.float32]:
    """[3, 4] matrix to (column, row, depth in mm) of a square map seen from a far light; depth grows away from it."""
    sideways = np.cross([0.0, 1.0, 0.0] if abs(direction[1]) < 0.99 else [0.0, 0.0, 1.0], direction)
    sideways /= np.linalg.norm(sideways)
    upward = np.cross(direction, sideways)
    scale = size / (2 * half_mm)
    rows = np.stack([sideways * scale, -upward * scale, -direction])
    offset = np.array([size / 2, size / 2, half_mm]) - rows @ np.asarray(centre_mm, np.float64)
    return np.concatenate([rows, offset[:, None]], axis=1).astype(np.float32)


def sky_visibility(
    points_mm: NDArray[np.float32], normals: NDArray[np.float32], quads: NDArray[np.int32], directions: int = 128
) -> NDArray[np.float32]:
    """[N] cosine-weighted share of the sky over each point that no quad hides, 0..1."""
    centre = (points_mm.max(axis=0) + points_mm.min(axis=0)) / 2
    half_mm = float(np.linalg.norm(points_mm - centre, axis=1).max()) + 1
    size = int(half_mm)  # texels of 2 mm
    seen, possible = np.zeros(len(points_mm)), np.full(len(points_mm), 1e-9)
    for direction in sky_directions(directions):
        cosine = np.maximum(normals @ direction, 0)
        matrix = orthographic(direction, centre, half_mm, size)
        screen = points_mm @ matrix[:, :3].T + matrix[:, 3]
        depth = np.full((size, size), FAR, np.float32)
        draw_depth(screen, quads, depth)
        lifted = (points_mm + 1.5 * normals) @ matrix[:, :3].T + matrix[:, 3]
        column, row = np.clip(lifted[:, :2].T.astype(np.int64), 0, size - 1)
        seen += cosine * (lifted[:, 2] < depth[row, column] + 1.0)
        possible += cosine
    return (seen / possible).astype(np.float32)
