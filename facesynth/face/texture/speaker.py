"""A speaker's pictures, each with its shape: what a textured face is drawn from, in one file."""

from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.atomic import atomic_path
from facesynth.face.texture.lips import Lips, facing, meeting
from facesynth.face.texture.mesh import ringed_mesh
from facesynth.inference.errors import FacesynthError
from facesynth.inference.npz import read_arrays
from facesynth.motion.planar import HeadMaps

LOOK_PX = 16
"""Side of the little grey picture of the lower face by which pictures are compared."""
OF_THE_MOUTH = ("inner_lips", "jaw", "shut", "pressed")
"""Arrays that files from before there were lips lack."""
OPENING_WEIGHT = 10.0
"""How much more than a point's place a distance of the lips counts where shapes are compared."""
SHUT_WEIGHT = 18.0
"""px; how much shut and open mouths differ where shapes are compared: more than jumps to a picture of shut lips and back."""
PRESSED_WEIGHT = 12.0
"""px; how much lips that are pressed together for a moment and others differ where shapes are compared."""
MOMENT_S = 0.3
"""Lips that are shut for longer rest: no p, b or m takes so long."""
SHUT_UP_TO = 0.06
"""Of the mouth's width: a mean distance of the inner lips from which on they count as open."""
MARGIN_PX = 4
"""Around the ring of the mesh, so that bilinear sampling always has neighbours."""


@dataclass(frozen=True, eq=False)
class Speaker:
    """N cut-out training pictures, clip after clip, and M whole pictures to lay them over."""

    pictures: NDArray[np.uint8]
    """[N, h, w, 3] the lower face, cut out of the whole pictures at one place."""
    corner: NDArray[np.int64]
    """[2] (x, y) px of that place's first pixel in the whole picture."""
    shapes: NDArray[np.float64]
    """[N, K, 2] px, head-fixed."""
    linear: NDArray[np.float64]
    """[N, 2, 2] and …"""
    shift: NDArray[np.float64]
    """[N, 2] … the map from head-fixed to whole-picture coordinates."""
    clip_starts: NDArray[np.bool_]
    """[N] whether a clip begins."""
    backgrounds: NDArray[np.uint8]
    """[M, H, W, 3] whole pictures that follow each other."""
    background_linear: NDArray[np.float64]
    """[M, 2, 2] and …"""
    background_shift: NDArray[np.float64]
    """[M, 2] … where the head is in them."""
    fps: float
    """Hz, of the pictures."""
    inner_lips: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    """Numbers of the points on the inner lips, the upper one with both corners, then the lower one back; none if unknown."""
    jaw: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    """Numbers of the points that move with the jaw."""
    shut: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    """px how far apart points of the inner lips that face each other are where lips are shut; none if unknown, see `meeting`."""
    pressed: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, np.bool_))
    """[N] whether a training picture shows lips at their narrowest in a p, b or m; none if unknown."""

    @property
    def knows_lips(self) -> bool:
        """Whether it is known where the mouth opens, and how the jaw moves."""
        return len(self.inner_lips) > 0 and len(self.jaw) > 1

    def meeting(self, shapes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Shapes [T, K, 2] with the inner lips where they end, as far as it is known; see `lips.meeting`."""
        if not len(self.shut):
            return shapes
        upper, lower = facing(self.inner_lips)
        usual = np.linalg.norm(self.shapes[:, lower] - self.shapes[:, upper], axis=-1).mean(axis=0)
        return meeting(shapes, self.inner_lips, self.shut, usual)

    @property
    def known(self) -> NDArray[np.float64]:
        """[N, K', 2] by which the training pictures are compared with `compared` shapes."""
        return self._compared(self.shapes, self.pressed if len(self.pressed) else np.zeros(len(self.shapes)))

    def compared(self, shapes: NDArray[np.float64]) -> NDArray[np.float64]:
        """[T, K', 2] by which shapes [T, K, 2] are compared: their points and, where the lips are known, how far these are open.

        A mouth of another opening is not told by its points alone: of two hundred, few lie on the lips.
        """
        return self._compared(shapes, self.pressing(shapes) if len(self.pressed) else np.zeros(len(shapes)))

    def _compared(self, shapes: NDArray[np.float64], pressed: NDArray[Any]) -> NDArray[np.float64]:
        if not self.knows_lips:
            return shapes
        known = np.concatenate([shapes, OPENING_WEIGHT * self.lips_apart(shapes)], axis=1)
        if not len(self.shut):
            return known
        # A shut mouth looks like no open one that is warped to it: lips are pressed together, and no hole is to be hidden.
        mouth = np.stack([SHUT_WEIGHT * self.shut_share(shapes), PRESSED_WEIGHT * pressed], axis=-1)[:, None]
        return np.concatenate([known, np.sqrt(known.shape[1]) * mouth], axis=1)

    def pressing(self, shapes: NDArray[np.float64]) -> NDArray[np.float64]:
        """[T] how far lips of shapes [T, K, 2] that follow each other are shut, where that is for a moment; else 0.

        A mesh has lips that rest on each other, and ones that are about to close, where pressed ones are; they look different.
        """
        shut = self.shut_share(shapes)
        edges = np.flatnonzero(np.diff(np.concatenate([[0], shut > 0.5, [0]]))).reshape(-1, 2)
        momentary = np.zeros(len(shapes))
        for start, stop in edges[np.diff(edges, axis=1)[:, 0] <= MOMENT_S * self.fps]:
            momentary[start:stop] = shut[start:stop]
        return momentary

    def shut_share(self, shapes: NDArray[np.float64]) -> NDArray[np.float64]:
        """[T] 1 where lips of shapes [T, K, 2], see `meeting`, are shut, 0 where they are clearly open, or none are known."""
        if not len(self.shut):
            return np.zeros(len(shapes))
        upper, lower = facing(self.inner_lips)
        opening = np.linalg.norm(shapes[:, lower] - shapes[:, upper], axis=-1).mean(axis=1)
        return np.clip(1 - opening / (SHUT_UP_TO * Lips.of(self.shapes, self.inner_lips).width), 0, 1)

    def lips_apart(self, shapes: NDArray[np.float64]) -> NDArray[np.float64]:
        """[T, U, 2] px how far the lips of shapes [T, K, 2] are apart, on a scale on which the first pixels count most.

        With w a tenth of the mouth's width and d a distance: w log(1 + d / w). Shut lips are told from lips that hardly open.
        """
        scale = Lips.of(self.shapes, self.inner_lips).width / 10
        lips = Lips.of(shapes, self.inner_lips)
        across = lips.lower - lips.upper
        return np.sign(across) * scale * np.log1p(np.abs(across) / scale)

    @property
    def head(self) -> HeadMaps:
        """Where the head was in each training picture."""
        return HeadMaps(self.linear, self.shift)

    @property
    def background_head(self) -> HeadMaps:
        """Where the head is in each whole picture."""
        return HeadMaps(self.background_linear, self.background_shift)

    @property
    def looks(self) -> NDArray[np.float64]:
        """[N, 256] the lower face in grey, head-fixed, its mean brightness taken out; in units of full brightness."""
        low, high = self.shapes.mean(axis=0).min(axis=0), self.shapes.mean(axis=0).max(axis=0)
        grid = np.stack(np.meshgrid(*np.linspace(low, high, LOOK_PX).T), axis=-1).reshape(1, -1, 2)
        placed = self.head.to_picture(np.broadcast_to(grid, (len(self.shapes), *grid.shape[1:])))
        at = np.round(placed - self.corner).astype(np.int64)
        height, width = self.pictures.shape[1:3]
        x, y = np.clip(at[:, :, 0], 0, width - 1), np.clip(at[:, :, 1], 0, height - 1)
        # kornia reads places in pictures of floats only: all of them turned into floats for 256 places took five times as long.
        grey = self.pictures[np.arange(len(at))[:, None], y, x].mean(axis=2) / 255
        return grey - grey.mean(axis=1, keepdims=True)

    def save(self, path: str | Path) -> None:
        """Write one compressed .npz, atomically."""
        with atomic_path(path) as part, open(part, "wb") as file:
            np.savez_compressed(file, **{known.name: getattr(self, known.name) for known in fields(self)})

    @classmethod
    def load(cls, path: str | Path) -> "Speaker":
        """Read what `save` wrote; FacesynthError for anything else."""
        if not Path(path).is_file():
            raise FacesynthError(f"{path}: no such file; it is made by `facesynth train` beside a model of followed points")
        required = [known.name for known in fields(cls) if known.name not in OF_THE_MOUTH]
        arrays: dict[str, Any] = read_arrays(path, "a file of the pictures of a speaker", required, OF_THE_MOUTH)
        speaker = cls(**{**arrays, "fps": float(arrays["fps"])})
        fault = _fault(speaker)
        if fault:
            raise FacesynthError(f"{path} holds no pictures of a speaker, or is damaged ({fault})")
        return speaker


def lower_face_window(shapes: NDArray[np.float64], head: HeadMaps, height: int, width: int) -> tuple[int, int, int, int]:
    """Left, top, right, bottom px of the part of pictures [H, W] in which the mesh over shapes [N, K, 2] ever lies."""
    mesh = ringed_mesh(shapes.mean(axis=0))
    return within(head.to_picture(mesh.vertices(shapes)), height, width)


def within(vertices: NDArray[np.float64], height: int, width: int) -> tuple[int, int, int, int]:
    """Left, top, right, bottom px of the part of a picture that vertices [T, V, 2] reach, with a margin."""
    low = np.floor(vertices.min(axis=(0, 1))).astype(int) - MARGIN_PX
    high = np.ceil(vertices.max(axis=(0, 1))).astype(int) + MARGIN_PX
    left, top = np.clip(low, 0, [width - 2, height - 2]).tolist()
    right, bottom = np.clip(high, [left + 2, top + 2], [width, height]).tolist()
    return left, top, right, bottom


def _fault(speaker: Speaker) -> str:
    """Which array does not have the shape that the others ask for; empty where all do."""
    count, points, backs = len(speaker.pictures), speaker.shapes.shape[1:2], len(speaker.backgrounds)
    wanted = {
        "pictures": (count, *speaker.pictures.shape[1:3], 3),
        "corner": (2,),
        "shapes": (count, *points, 2),
        "linear": (count, 2, 2),
        "shift": (count, 2),
        "clip_starts": (count,),
        "backgrounds": (backs, *speaker.backgrounds.shape[1:3], 3),
        "background_linear": (backs, 2, 2),
        "background_shift": (backs, 2),
    }
    for name, shape in wanted.items():
        array = getattr(speaker, name)
        if array.shape != shape or not array.size or not np.isfinite(array).all():
            return f"{name} has shape {array.shape}, or is not finite"
    if len(speaker.shut) and (speaker.shut.shape != facing(speaker.inner_lips)[0].shape or not np.isfinite(speaker.shut).all()):
        return f"shut has shape {speaker.shut.shape}, or is not finite"
    if len(speaker.pressed) and (speaker.pressed.shape != (count,) or speaker.pressed.dtype.kind != "b"):
        return f"pressed has shape {speaker.pressed.shape}, or does not say yes or no"
    for name in ("inner_lips", "jaw"):
        numbers = getattr(speaker, name)
        if (
            numbers.ndim != 1
            or numbers.dtype.kind != "i"
            or (len(numbers) and not 0 <= numbers.min() <= numbers.max() < points[0])
        ):
            return f"{name} are no numbers of points"
    return ""
