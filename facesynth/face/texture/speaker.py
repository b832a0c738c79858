"""A speaker's pictures, each with its shape: what a textured face is drawn from, in one file."""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.atomic import atomic_path
from facesynth.errors import FacesynthError
from facesynth.face.texture.shapes import HeadMaps, Shapes

LOOK_PX = 16
"""Side of the little grey picture of the lower face by which pictures are compared."""


@dataclass(frozen=True, eq=False)
class Speaker:
    """N training pictures, clip after clip."""

    pictures: NDArray[np.uint8]
    """[N, H, W, 3]"""
    shapes: NDArray[np.float64]
    """[N, K, 2] px, head-fixed."""
    linear: NDArray[np.float64]
    """[N, 2, 2] and …"""
    shift: NDArray[np.float64]
    """[N, 2] … the map from head-fixed to picture coordinates."""
    clip_starts: NDArray[np.bool_]
    """[N] whether a clip begins."""
    fps: float
    """Hz, of the pictures."""

    @property
    def head(self) -> HeadMaps:
        """Where the head was in each picture."""
        return HeadMaps(self.linear, self.shift)

    @property
    def looks(self) -> NDArray[np.float64]:
        """[N, 256] the lower face in grey, head-fixed, its mean brightness taken out; in units of full brightness."""
        low, high = self.shapes.mean(axis=0).min(axis=0), self.shapes.mean(axis=0).max(axis=0)
        grid = np.stack(np.meshgrid(*np.linspace(low, high, LOOK_PX).T), axis=-1).reshape(1, -1, 2)
        at = np.round(self.head.to_picture(np.broadcast_to(grid, (len(self.shapes), *grid.shape[1:])))).astype(np.int64)
        height, width = self.pictures.shape[1:3]
        x, y = np.clip(at[:, :, 0], 0, width - 1), np.clip(at[:, :, 1], 0, height - 1)
        grey = self.pictures[np.arange(len(at))[:, None], y, x].mean(axis=2) / 255
        return grey - grey.mean(axis=1, keepdims=True)

    def save(self, path: str | Path) -> None:
        """Write one compressed .npz, atomically."""
        with atomic_path(path) as part, open(part, "wb") as file:
            np.savez_compressed(file, **{field.name: getattr(self, field.name) for field in fields(self)})

    @classmethod
    def load(cls, path: str | Path) -> Speaker:
        """Read what `save` wrote; FacesynthError for anything else."""
        if not Path(path).is_file():
            raise FacesynthError(f"{path}: no such file; make it from video of the speaker")
        try:
            with open(path, "rb") as file, np.load(file, allow_pickle=False) as stored:
                arrays = {field.name: stored[field.name] for field in fields(cls)}
        except (OSError, ValueError, KeyError, EOFError, AttributeError, TypeError, zipfile.BadZipFile) as error:
            raise FacesynthError(f"{path} holds no pictures of a speaker, or is damaged ({error})") from None
        return cls(**{**arrays, "fps": float(arrays["fps"])})


def speaker_of(clips: Sequence[NDArray[np.uint8]], shapes: Sequence[Shapes]) -> Speaker:
    """From clips of pictures [T, H, W, 3] and their shapes."""
    starts = np.concatenate([np.arange(len(clip)) == 0 for clip in clips])
    return Speaker(
        np.concatenate(list(clips)),
        np.concatenate([shape.points for shape in shapes]),
        np.concatenate([shape.head.linear for shape in shapes]),
        np.concatenate([shape.head.shift for shape in shapes]),
        starts,
        shapes[0].fps,
    )
