"""Pictures of a head, drawn by the processor alone: no window, no graphics driver."""

import os
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import islice
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from facesynth.face.draw.bake import built_in_look
from facesynth.face.draw.camera import Camera
from facesynth.face.draw.furrows import pushed_together, vertex_areas
from facesynth.face.draw.light import KEY
from facesynth.face.draw.look import Eyeball, LitSphere, Look
from facesynth.face.draw.occlusion import orthographic, sky_visibility
from facesynth.face.draw.raster import FAR, TILE, bin_segments, bin_triangles, draw_depth, nearest_first, vertex_normals
from facesynth.face.draw.shading import HIDDEN, OPEN_MM, SKIN, Shot, Surface
from facesynth.face.draw.shadow import with_bounds
from facesynth.face.draw.strands import Strands
from facesynth.face.draw.tiles import NO_HAIR, Bins, Hair, draw_tiles, light_hair
from facesynth.face.rig.arkit_rig import Rig
from facesynth.face.rig.own_head import OwnHead
from facesynth.inference.errors import FacesynthError
from facesynth.motion.arkit_names import ARKIT_NAMES
from facesynth.progress import track


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


GLOSS = 0.35
OPEN_JAW = 0.45
_WHOLE_HEAD = 2.1
"""Height of the picture over that of what the face's shapes move."""
_WELD_MM = 1e-3


def own_look(head: OwnHead) -> Look:
    """Colours as the head's file has them; every vertex as bright as the sky it sees with the jaw shut or open."""
    quads = np.ascontiguousarray(head.triangles[:, [0, 1, 2, 2]], np.int32)
    welded = _welded(head.rest_mm)
    texture = np.empty((*head.colours.shape[:3], 4), np.uint8)
    texture[..., :3] = np.round(255 * np.sqrt(np.clip(head.colours, 0, 1)))
    texture[..., 3] = round(255 * GLOSS)
    occlusion = np.max([_sky_over(head, quads, welded, value) for value in (0.0, OPEN_JAW)], axis=0)
    open_sky = np.ones(len(head.rest_mm), np.float32)
    surface = Surface(quads, np.full(len(quads), SKIN, np.uint8), head.rest_mm, occlusion, open_sky, texture)
    reach_mm = float(np.linalg.norm(head.face_mm[1] - head.face_mm[0]))
    return Look(surface, LitSphere(np.zeros(3), reach_mm), framing(head), welded=welded)


def framing(head: OwnHead) -> Camera:
    """A camera that sees the whole head from the front."""
    height_mm = _WHOLE_HEAD * float(head.face_mm[1, 1] - head.face_mm[0, 1])
    far_mm = height_mm / 2 / np.tan(np.radians(Camera.field_of_view_deg) / 2)
    return Camera((0.0, 0.0, float(head.face_mm[1, 2]) + far_mm), (0.0, 0.0, 0.0))


def _sky_over(head: OwnHead, quads: NDArray[np.int32], welded: NDArray[np.int64], jaw_open: float) -> NDArray[np.float32]:
    """[V] what each vertex sees of the sky: teeth do so when the jaw is open."""
    weights = np.zeros((1, len(ARKIT_NAMES)))
    weights[0, ARKIT_NAMES.index("jawOpen")] = jaw_open
    posed = head.posed(head.map.own(weights)[0] - head.map.own(0 * weights)[0])
    normal = vertex_normals(posed, welded[quads].astype(np.int32))[welded]
    return sky_visibility(posed, normal, quads, directions=48)


def _welded(vertices: NDArray[np.float32]) -> NDArray[np.int64]:
    """[V] the first vertex at the same place: files split vertices at seams, which must not show in the light."""
    places = np.round(vertices / _WELD_MM).astype(np.int64)
    _, first, inverse = np.unique(places, axis=0, return_index=True, return_inverse=True)
    return first[np.ravel(inverse)]


_SHADOW_SIZE = 512
_STRAND_BUCKETS = 4096
_CHUNKS_PER_THREAD = 8
_AHEAD = 3
"""Pictures that are in work at once: one is drawn while the one before it is encoded."""

Binned = tuple[NDArray[np.int32], NDArray[np.int32]]


class Renderer:
    """Draws posed vertices of a head; the first picture of a fresh installation waits for numba to compile."""

    def __init__(self, look: Look, size: tuple[int, int] = (1280, 720), camera: Camera | None = None) -> None:
        if len(size) != 2 or min(size) < 16 or max(size) > 8192:
            raise FacesynthError(f"a picture's size must be (width, height), each 16 to 8192 pixels; got {size}")
        self.look, self.size, self.camera = look, (int(size[0]), int(size[1])), camera or look.camera
        self._drawn = look.surface.quads[look.surface.material != HIDDEN]
        self._normal_quads = look.normal_quads
        self._rest_areas = vertex_areas(look.surface.rest, self._normal_quads) if look.furrows else None
        self._grid = (-(-self.size[0] // TILE), -(-self.size[1] // TILE))
        self._backdrop, self._curve = backdrop(*self.size), display_curve()
        self._light = orthographic(KEY, *look.lit, _SHADOW_SIZE)
        threads = available_cores()
        tiles = np.random.default_rng(0).permutation(self._grid[0] * self._grid[1])  # so that every chunk is as much work
        self._chunks = np.array_split(tiles, threads * _CHUNKS_PER_THREAD)
        self._pool = ThreadPoolExecutor(threads, "render")

    @classmethod
    def of(cls, head: Rig | OwnHead, size: tuple[int, int] = (1280, 720), camera: Camera | None = None) -> Self:
        """A renderer of the built-in head or of one's own."""
        return cls(own_look(head) if isinstance(head, OwnHead) else built_in_look(head), size, camera)

    def render(self, vertices: ArrayLike) -> NDArray[np.uint8]:
        """The picture [height, width, 3] of vertices [V, 3] in mm."""
        posed, look = np.ascontiguousarray(vertices, np.float32), self.look
        if posed.shape != (look.vertex_count, 3) or not np.isfinite(posed).all():
            raise FacesynthError(f"vertices must be finite and have shape {(look.vertex_count, 3)}; got {posed.shape}")
        position = posed if look.refine is None else look.refine @ posed
        normal = self._normals(position)
        shadow = self._pool.submit(self._shadow, position, normal)
        strands = self._pool.submit(self._hair, position, normal)
        screen = self.camera.project(position, self.size)
        triangle_bins = bin_triangles(screen, self._drawn, *self._grid)
        hair, segment_bins = strands.result()
        eyes, mouth_mm = _eye_frames(look.eyes, posed), _mouth_mm(look.lips, posed)
        shot = Shot(screen, position, normal, shadow.result(), self._light, eyes, self._camera_mm, mouth_mm, self._lost(position))
        picture = np.empty((self.size[1], self.size[0], 3), np.uint8)
        job = (look.surface, shot, hair, Bins(*triangle_bins, *segment_bins), self._backdrop, self._curve, picture)
        for done in [self._pool.submit(draw_tiles, chunk, *job) for chunk in self._chunks]:
            done.result()
        return picture

    def pictures(self, count: int, vertices: Callable[[int], ArrayLike]) -> Iterator[NDArray[np.uint8]]:
        """Pictures [height, width, 3] of `vertices(k)` for k below `count`; the next are drawn while one is used."""

        def draw(k: int) -> NDArray[np.uint8]:
            return self.render(vertices(k))

        frames, ahead = iter(range(count)), deque[Future[NDArray[np.uint8]]]()
        with ThreadPoolExecutor(_AHEAD - 1, "picture") as painters:
            for _ in track(range(count), "rendering"):
                for k in islice(frames, _AHEAD - len(ahead)):
                    ahead.append(painters.submit(draw, k))
                yield ahead.popleft().result()

    @property
    def _camera_mm(self) -> NDArray[np.float32]:
        return np.asarray(self.camera.position_mm, np.float32)

    def _normals(self, position: NDArray[np.float32]) -> NDArray[np.float32]:
        normal, welded = vertex_normals(position, self._normal_quads), self.look.welded
        return normal if welded is None else normal[welded]

    def _lost(self, position: NDArray[np.float32]) -> NDArray[np.float32]:
        if self._rest_areas is None:
            return np.zeros(len(position), np.float32)
        return pushed_together(position, self._normal_quads, self._rest_areas)

    def _shadow(self, position: NDArray[np.float32], normal: NDArray[np.float32]) -> NDArray[np.float32]:
        cap = self.look.cap_mm
        outer = position if cap is None else position + normal * cap[:, None]
        screen = outer @ self._light[:, :3].T + self._light[:, 3]
        depth = np.full((_SHADOW_SIZE, _SHADOW_SIZE), FAR, np.float32)
        draw_depth(screen, self._drawn, depth)
        return with_bounds(depth)

    def _hair(self, position: NDArray[np.float32], normal: NDArray[np.float32]) -> tuple[Hair, Binned]:
        if self.look.strands is None:
            return NO_HAIR, (np.zeros(self._grid[0] * self._grid[1] + 1, np.int32), np.zeros(0, np.int32))
        return self._carried(self.look.strands, position, normal)

    def _carried(self, strands: Strands, position: NDArray[np.float32], normal: NDArray[np.float32]) -> tuple[Hair, Binned]:
        """Strands as the surface carries them in this frame."""
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


def _mouth_mm(lips: NDArray[np.int64] | None, posed: NDArray[np.float32]) -> NDArray[np.float32]:
    """[1] opening of the lips; a head whose lips are not known counts as open, so that light gets in."""
    if lips is None:
        return np.full(1, OPEN_MM, np.float32)
    upper, lower = lips
    return np.linalg.norm(posed[upper] - posed[lower], axis=1).mean(keepdims=True).astype(np.float32)


def _eye_frames(eyes: tuple[Eyeball, Eyeball] | None, posed: NDArray[np.float32]) -> NDArray[np.float32]:
    """[2, 4, 3] how each eyeball stands: the rotation that brings it back to rest, and its centre."""
    frames = np.zeros((2, 4, 3), np.float32)
    for frame, eye in zip(frames, eyes or (), strict=False):
        rest, now = eye.rest_mm.astype(np.float64), posed[eye.vertices].astype(np.float64)
        turn = Rotation.align_vectors(now - now.mean(axis=0), rest - rest.mean(axis=0))[0]
        frame[:3] = turn.inv().as_matrix()
        frame[3] = now.mean(axis=0) + turn.apply(eye.centre_mm - rest.mean(axis=0))
    return frames


def available_cores() -> int:
    """Processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
