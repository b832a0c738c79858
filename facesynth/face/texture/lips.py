"""The inner lips of shapes: how far they are apart, where they meet, and what lies between them."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.arrays import Floats

LEFT_OPEN = 0.04
"""Of the mean distance of two facing points, what is left between lips that meet: triangles between them keep an area."""


@dataclass(frozen=True, eq=False)
class Lips:
    """The inner lips of T shapes, head-fixed px, y down."""

    upper: Floats
    """[T, U, 2] from one corner to the other."""
    lower: Floats
    """[T, U, 2] from the same corner to the other one."""

    @classmethod
    def of(cls, shapes: Floats, outline: NDArray[np.int64]) -> Self:
        """From shapes [T, K, 2] and the outline's point numbers: the upper lip with both corners, then the lower one back."""
        corners = len(outline) // 2 + 1
        upper = shapes[:, outline[:corners]]
        return cls(upper, np.concatenate([upper[:, :1], shapes[:, outline[corners:]][:, ::-1], upper[:, -1:]], axis=1))

    @property
    def width(self) -> float:
        """px from corner to corner, over all shapes."""
        return float(np.linalg.norm(self.upper[:, 0] - self.upper[:, -1], axis=1).mean())

    def between(self, t: int, places: Floats) -> tuple[Floats, Floats]:
        """How deep places [..., 2] lie in the mouth of shape t, px, negative outside; and how far down, 0 to 1."""
        x, y = places[..., 0], places[..., 1]
        top, bottom = (_height(row[t], x) for row in (self.upper, self.lower))
        depth = np.minimum(y - top, bottom - y)
        return depth, (y - top) / np.maximum(bottom - top, 1e-6)


def facing(outline: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Numbers of the points of the upper and of the lower lip that face each other [U], without the corners."""
    corners = len(outline) // 2 + 1
    return outline[1 : corners - 1], outline[corners:][::-1]


def meeting(shapes: Floats, outline: NDArray[np.int64], shut: Floats, usual: Floats) -> Floats:
    """Shapes [T, K, 2] with the points of the inner lips where the lips end, so that they meet where lips are shut.

    A face mesh lays them on the red of the lips: facing points are `shut` [U] px apart though the lips touch, `usual` [U] px
    on average. Both go half of the way that they are too far apart towards each other, so that a warp from open lips to
    shut ones leaves nothing of what was seen between them.
    """
    upper, lower = facing(outline)
    across = shapes[:, lower] - shapes[:, upper]
    distance = np.linalg.norm(across, axis=-1, keepdims=True)
    left = np.maximum(distance - shut[:, None], np.minimum(distance, LEFT_OPEN * usual[:, None]))
    kept = left / np.maximum(distance, 1e-9)
    out = shapes.copy()
    out[:, upper] += across * (1 - kept) / 2
    out[:, lower] -= across * (1 - kept) / 2
    return out


def _height(row: Floats, x: Floats) -> Floats:
    """y of a row of points [U, 2] at x; beyond its ends that of the ends, so that upper and lower lip meet there."""
    order = np.argsort(row[:, 0], kind="stable")
    return np.interp(x, row[order, 0], row[order, 1])
