"""Points of a face in the plane of a picture: their layout, and where the head was."""

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.layout import Layout

_NAME = re.compile(r"p\d{3,}")


@dataclass(frozen=True, eq=False)
class HeadMaps:
    """For each frame the map p -> p @ linear + shift from head-fixed to picture coordinates (rows are points)."""

    linear: NDArray[np.float64]
    """[T, 2, 2]"""
    shift: NDArray[np.float64]
    """[T, 2] px."""

    def to_picture(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points [T, K, 2] px."""
        return points @ self.linear + self.shift[:, None]

    def to_head(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """The inverse of `to_picture`."""
        return (points - self.shift[:, None]) @ np.linalg.inv(self.linear)

    def at(self, numbers: NDArray[np.int64]) -> "HeadMaps":
        """Those of some frames."""
        return HeadMaps(self.linear[numbers], self.shift[numbers])


def tracked_layout(count: int) -> Layout:
    """Points followed in video have no names of their own: p000, p001, …; all of them move with the mouth."""
    return Layout("landmarks", tuple(f"p{i:03d}" for i in range(count)), {"mouth": tuple(range(count))})


def is_tracked(layout: Layout) -> bool:
    """Whether a layout is of points followed in video."""
    return layout.kind == "landmarks" and all(_NAME.fullmatch(name) for name in layout.names)


def picture_points(frames: NDArray[np.float32]) -> NDArray[np.float64]:
    """Frames [T, 2 K] of a motion, whose y points up, to points [T, K, 2] px, y down as in pictures."""
    return frames.reshape(len(frames), -1, 2).astype(np.float64) * [1, -1]


def motion_frames(points: NDArray[np.float64]) -> NDArray[np.float32]:
    """The inverse of `picture_points`."""
    return (points * [1, -1]).reshape(len(points), -1).astype(np.float32)
