"""Pictures of a head of somebody's own: its own colours under the same lights as the built-in head."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facesynth.face.draw.occlusion import orthographic, sky_visibility
from facesynth.face.draw.raster import FAR, TILE, bin_triangles, draw_depth, vertex_normals
from facesynth.face.draw.render import Camera, available_cores, backdrop, display_curve
from facesynth.face.draw.shading import KEY, SKIN, Shot, Surface, with_bounds
from facesynth.face.draw.tiles import Bins, Hair, draw_tiles
from facesynth.face.own_animation import OwnAnimation
from facesynth.face.rig.arkit import ARKIT_NAMES
from facesynth.face.rig.own_head import OwnHead
from facesynth.inference.errors import FacesynthError
from facesynth.progress import track

GLOSS = 0.35
OPEN_JAW = 0.45
_SHADOW_SIZE = 512
_WHOLE_HEAD = 2.1
"""Height of the picture over that of what the face's shapes move."""
_CHUNKS_PER_THREAD = 8
_WELD_MM = 1e-3


class OwnRenderer:
    """Draws posed vertices of an own head."""

    def __init__(self, head: OwnHead, size: tuple[int, int] = (1280, 720), camera: Camera | None = None) -> None:
        if len(size) != 2 or min(size) < 16 or max(size) > 8192:
            raise FacesynthError(f"a picture's size must be (width, height), each 16 to 8192 pixels; got {size}")
        self.head, self.size, self.camera = head, (int(size[0]), int(size[1])), camera or framing(head)
        self._quads = np.ascontiguousarray(head.triangles[:, [0, 1, 2, 2]], np.int32)
        self._first = _welded(head.rest_mm)
        self._welded = self._first[self._quads].astype(np.int32)
        self._surface = self._painted()
        self._reach_mm = float(np.linalg.norm(head.face_mm[1] - head.face_mm[0]))
        self._light = orthographic(KEY, np.zeros(3), self._reach_mm, _SHADOW_SIZE)
        self._grid = (-(-self.size[0] // TILE), -(-self.size[1] // TILE))
        self._backdrop, self._curve = backdrop(*self.size), display_curve()
        threads = available_cores()
        tiles = np.random.default_rng(0).permutation(self._grid[0] * self._grid[1])
        self._chunks = np.array_split(tiles, threads * _CHUNKS_PER_THREAD)
        self._pool = ThreadPoolExecutor(threads, "render")

    def render(self, vertices: ArrayLike) -> NDArray[np.uint8]:
        """The picture [height, width, 3] of vertices [V, 3] in mm."""
        position = np.ascontiguousarray(vertices, np.float32)
        if position.shape != self.head.rest_mm.shape or not np.isfinite(position).all():
            raise FacesynthError(f"vertices must be finite and have shape {self.head.rest_mm.shape}; got {position.shape}")
        normal = vertex_normals(position, self._welded)[self._first]
        shadow = np.full((_SHADOW_SIZE, _SHADOW_SIZE), FAR, np.float32)
        draw_depth(position @ self._light[:, :3].T + self._light[:, 3], self._quads, shadow)
        screen = self.camera.project(position, self.size)
        bins = bin_triangles(screen, self._quads, *self._grid)
        no_segments = (np.zeros(self._grid[0] * self._grid[1] + 1, np.int32), np.zeros(0, np.int32))
        camera_mm = np.asarray(self.camera.position_mm, np.float32)
        eyes, mouth_mm = np.zeros((2, 4, 3), np.float32), np.full(1, 7.0, np.float32)
        shot = Shot(screen, position, normal, with_bounds(shadow), self._light, eyes, camera_mm, mouth_mm)
        picture = np.empty((self.size[1], self.size[0], 3), np.uint8)
        job = (self._surface, shot, _BALD, Bins(*bins, *no_segments), self._backdrop, self._curve, picture)
        for done in [self._pool.submit(draw_tiles, chunk, *job) for chunk in self._chunks]:
            done.result()
        return picture

    def pictures(self, animation: OwnAnimation) -> Iterator[NDArray[np.uint8]]:
        """Pictures [height, width, 3], one for each frame."""
        for k in track(range(len(animation)), "rendering"):
            yield self.render(self.head.posed(animation.values[k], animation.head[k], animation.gaze[k]))

    def _painted(self) -> Surface:
        head, count = self.head, len(self._quads)
        texture = np.empty((*head.colours.shape[:3], 4), np.uint8)
        texture[..., :3] = np.round(255 * np.sqrt(np.clip(head.colours, 0, 1)))
        texture[..., 3] = round(255 * GLOSS)
        occlusion = np.max([self._sky_over(value) for value in (0.0, OPEN_JAW)], axis=0)
        open_sky = np.ones(len(head.rest_mm), np.float32)
        return Surface(self._quads, np.full(count, SKIN, np.uint8), head.rest_mm, occlusion, open_sky, texture)

    def _sky_over(self, jaw_open: float) -> NDArray[np.float32]:
        """[V] what each vertex sees of the sky: teeth do so when the jaw is open."""
        weights = np.zeros((1, len(ARKIT_NAMES)))
        weights[0, ARKIT_NAMES.index("jawOpen")] = jaw_open
        posed = self.head.posed(self.head.map.own(weights)[0] - self.head.map.own(0 * weights)[0])
        return sky_visibility(posed, vertex_normals(posed, self._welded)[self._first], self._quads, directions=48)


_BALD = Hair(np.zeros((0, 3), np.float32), np.zeros(0, np.float32), np.zeros((0, 3), np.float32), np.zeros((0, 2), np.int32))


def framing(head: OwnHead) -> Camera:
    """A camera that sees the whole head from the front."""
    height_mm = _WHOLE_HEAD * float(head.face_mm[1, 1] - head.face_mm[0, 1])
    far_mm = height_mm / 2 / np.tan(np.radians(Camera.field_of_view_deg) / 2)
    return Camera((0.0, 0.0, float(head.face_mm[1, 2]) + far_mm), (0.0, 0.0, 0.0))


def _welded(vertices: NDArray[np.float32]) -> NDArray[np.int64]:
    """[V] the first vertex at the same place: files split vertices at seams, which must not show in the light."""
    places = np.round(vertices / _WELD_MM).astype(np.int64)
    _, first, inverse = np.unique(places, axis=0, return_index=True, return_inverse=True)
    return first[np.ravel(inverse)]
