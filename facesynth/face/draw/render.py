"""Pictures of the built-in head, drawn by the processor alone: no window, no graphics driver."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from facesynth.face.draw.bake import baked_head
from facesynth.face.draw.occlusion import orthographic
from facesynth.face.draw.raster import FAR, TILE, bin_segments, bin_triangles, draw_depth, nearest_first, project, vertex_normals
from facesynth.face.draw.shading import HIDDEN, KEY, Shot, with_bounds
from facesynth.face.draw.tiles import Bins, Hair, draw_tiles, light_hair
from facesynth.face.rig.arkit_rig import Rig
from facesynth.face.rig.markers import INNER_LIPS
from facesynth.inference.errors import FacesynthError

_SHADOW_SIZE, _SHADOW_HALF_MM = 512, 190.0
_SHADOW_CENTRE_MM = np.array([0.0, -30.0, 60.0])
_STRAND_BUCKETS = 4096
_CHUNKS_PER_THREAD = 8


@dataclass(frozen=True)
class Camera:
    """A pinhole whose picture has the performer's left on its right."""

    position_mm: tuple[float, float, float] = (0.0, -22.0, 1010.0)
    target_mm: tuple[float, float, float] = (0.0, -24.0, 60.0)
    field_of_view_deg: float = 18.0
    """Vertical."""

    def focal_px(self, height_px: int) -> float:
        """Pixels per unit of tangent."""
        return float(height_px / 2 / np.tan(np.radians(self.field_of_view_deg) / 2))

    def project(self, points_mm: NDArray[Any], size: tuple[int, int]) -> NDArray[np.float32]:
        """[N, 3] column and row in pixels, and depth in mm along the view, of points [N, 3] in mm."""
        return project(
            np.ascontiguousarray(points_mm, np.float32), self._axes(), np.array(size, np.float32) / 2, self.focal_px(size[1])
        )

    def _axes(self) -> NDArray[np.float32]:
        """[4, 3] directions of columns, of rows and of depth, and the position."""
        back = np.subtract(self.position_mm, self.target_mm)
        back /= np.linalg.norm(back)
        right = np.cross([0.0, 1.0, 0.0], back)
        right /= np.linalg.norm(right)
        return np.array([right, -np.cross(back, right), -back, self.position_mm], np.float32)


class Renderer:
    """Draws posed vertices of the built-in head; the first picture of a fresh installation waits for numba to compile."""

    def __init__(self, rig: Rig, size: tuple[int, int] = (1280, 720), camera: Camera | None = None) -> None:
        if len(size) != 2 or min(size) < 16 or max(size) > 8192:
            raise FacesynthError(f"a picture's size must be (width, height), each 16 to 8192 pixels; got {size}")
        self.rig, self.size, self.camera = rig, (int(size[0]), int(size[1])), camera or Camera()
        self._baked = baked_head(rig)
        self._drawn = self._baked.surface.quads[self._baked.surface.material != HIDDEN]
        self._grid = (-(-self.size[0] // TILE), -(-self.size[1] // TILE))
        self._backdrop, self._curve = backdrop(*self.size), display_curve()
        self._light = orthographic(KEY, _SHADOW_CENTRE_MM, _SHADOW_HALF_MM, _SHADOW_SIZE)
        self._eyes = [(rig.vertices_of(f"{side}_eye"), rig.eye_centre_mm(side)) for side in ("left", "right")]
        self._lips = rig.from_source(np.array(INNER_LIPS[2:5]).T)
        threads = available_cores()
        tiles = np.random.default_rng(0).permutation(self._grid[0] * self._grid[1])  # so that every chunk is as much work
        self._chunks = np.array_split(tiles, threads * _CHUNKS_PER_THREAD)
        self._pool = ThreadPoolExecutor(threads, "render")

    def render(self, vertices: ArrayLike) -> NDArray[np.uint8]:
        """The picture [height, width, 3] of vertices [V, 3] in mm."""
        posed = np.asarray(vertices, np.float32)
        if posed.shape != self.rig.rest_mm.shape or not np.isfinite(posed).all():
            raise FacesynthError(f"vertices must be finite and have shape {self.rig.rest_mm.shape}; got {posed.shape}")
        position = self._baked.refine @ posed
        normal = vertex_normals(position, self._baked.surface.quads)
        shadow = self._pool.submit(self._shadow, position, normal)
        strands = self._pool.submit(self._hair, position, normal)
        screen = self.camera.project(position, self.size)
        triangle_bins = bin_triangles(screen, self._drawn, *self._grid)
        hair, segment_bins = strands.result()
        shot = Shot(
            screen,
            position,
            normal,
            shadow.result(),
            self._light,
            self._eye_frames(posed),
            self._camera_mm,
            self._mouth_mm(posed),
        )
        picture = np.empty((self.size[1], self.size[0], 3), np.uint8)
        job = (self._baked.surface, shot, hair, Bins(*triangle_bins, *segment_bins), self._backdrop, self._curve, picture)
        for done in [self._pool.submit(draw_tiles, chunk, *job) for chunk in self._chunks]:
            done.result()
        return picture

    @property
    def _camera_mm(self) -> NDArray[np.float32]:
        return np.asarray(self.camera.position_mm, np.float32)

    def _shadow(self, position: NDArray[np.float32], normal: NDArray[np.float32]) -> NDArray[np.float32]:
        outer = position + normal * self._baked.cap_mm[:, None]
        screen = outer @ self._light[:, :3].T + self._light[:, 3]
        depth = np.full((_SHADOW_SIZE, _SHADOW_SIZE), FAR, np.float32)
        draw_depth(screen, self._drawn, depth)
        return with_bounds(depth)

    def _hair(self, position: NDArray[np.float32], normal: NDArray[np.float32]) -> tuple[Hair, tuple[NDArray, NDArray]]:
        strands = self._baked.strands
        ground = strands.binding @ normal
        points = strands.binding @ position + strands.lift_mm[:, None] * ground
        screen = self.camera.project(points, self.size)
        screen[:, 2] -= strands.raised_mm
        width_px = strands.width_mm * np.float32(self.camera.focal_px(self.size[1])) / screen[:, 2]
        away = self._camera_mm - points
        facing = (ground * away).sum(axis=1) / np.linalg.norm(away, axis=1) + strands.horizon
        colour = light_hair(points, ground, strands.segments, strands.colour, self._camera_mm)
        order = nearest_first(screen, strands.segments, facing, _STRAND_BUCKETS)
        bins = bin_segments(screen, strands.segments, order, 2.0, *self._grid)
        return Hair(screen, width_px, colour, strands.segments), bins

    def _mouth_mm(self, posed: NDArray[np.float32]) -> NDArray[np.float32]:
        upper, lower = self._lips
        return np.linalg.norm(posed[upper] - posed[lower], axis=1).mean(keepdims=True).astype(np.float32)

    def _eye_frames(self, posed: NDArray[np.float32]) -> NDArray[np.float32]:
        """[2, 4, 3] how each eyeball stands: the rotation that brings it back to rest, and its centre."""
        frames = []
        for ball, centre in self._eyes:
            rest, now = self.rig.rest_mm[ball].astype(np.float64), posed[ball].astype(np.float64)
            turn = Rotation.align_vectors(now - now.mean(axis=0), rest - rest.mean(axis=0))[0]
            moved = now.mean(axis=0) + turn.apply(centre - rest.mean(axis=0))
            frames.append(np.vstack([turn.inv().as_matrix(), moved]))
        return np.array(frames, np.float32)


def available_cores() -> int:
    """Processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def backdrop(width: int, height: int) -> NDArray[np.float32]:
    """[height, width, 3] a grey studio wall, brighter behind the lit side, with a little noise against banding."""
    y, x = np.mgrid[0:height, 0:width] / float(height)
    distance = np.hypot((x - 0.42 * width / height) * 1.0, (y - 0.40) * 1.15)
    glow = 0.20 * np.exp(-((distance / 0.75) ** 2)) + 0.036
    grain = np.random.default_rng(7).normal(0, 0.0012, (height, width))
    return ((glow + grain)[..., None] * np.array([0.92, 0.97, 1.06])).clip(0).astype(np.float32)


def display_curve(steps: int = 16384) -> NDArray[np.uint8]:
    """[steps] display value of linear light 0..4: a shoulder that keeps highlights, then the sRGB curve."""
    linear = (np.arange(steps) + 0.5) * 4 / steps
    mapped = 0.80 * linear * (1 + linear / 12.0) / (1 + 0.42 * linear)
    encoded = np.where(mapped <= 0.0031308, 12.92 * mapped, 1.055 * np.maximum(mapped, 1e-9) ** (1 / 2.4) - 0.055)
    return np.round(255 * np.clip(encoded, 0, 1)).astype(np.uint8)
