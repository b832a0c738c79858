"""Points of a face in the plane of a picture: their layout, and where the head was."""

import re
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.layout import Layout

MOUTH_ROWS = {"upper_outer": 11, "lower_outer": 9, "upper_inner": 11, "lower_inner": 9, "chin": 8}
"""Points of the lips and the chin, row by row, from the performer's right to left; corners of the mouth are in the upper rows."""
_MOUTH_NAMES = tuple(f"{row}_{number:02d}" for row, count in MOUTH_ROWS.items() for number in range(count))
_FACING = ((4, 3), (5, 4), (6, 5))
"""In the middle of the inner rows, upper and lower."""
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


def tracked_layout(count: int, *, mouth: bool = False) -> Layout:
    """Points followed in video have no names of their own: p000, p001, …; all of them move with the mouth.

    With `mouth` the rows of lips and chin of MOUTH_ROWS come behind them, so that the lips are known.
    """
    names = tuple(f"p{i:03d}" for i in range(count))
    if not mouth:
        return Layout("landmarks", names, {"mouth": tuple(range(count))})
    rows = _rows(count)
    lips = {
        "lips_inner": rows["upper_inner"] + rows["lower_inner"],
        "lips_outer": rows["upper_outer"] + rows["lower_outer"],
        "upper_lip": rows["upper_outer"] + rows["upper_inner"],
        "lower_lip": rows["lower_outer"] + rows["lower_inner"],
        "jaw": rows["chin"],
    }
    groups = {"mouth": lips["upper_lip"] + lips["lower_lip"], **lips}
    pairs = tuple((rows["upper_inner"][upper], rows["lower_inner"][lower]) for upper, lower in _FACING)
    return Layout("landmarks", names + _MOUTH_NAMES, groups, pairs)


def _rows(first: int) -> dict[str, tuple[int, ...]]:
    """Numbers of the points in each row, where the first row begins with point `first`."""
    stops = np.cumsum([first, *MOUTH_ROWS.values()]).tolist()
    return {row: tuple(range(*ends)) for row, ends in zip(MOUTH_ROWS, pairwise(stops), strict=True)}


def is_tracked(layout: Layout) -> bool:
    """Whether a layout is of points followed in video, with the mouth or without."""
    followed = layout.names[: -len(_MOUTH_NAMES)] if has_mouth(layout) else layout.names
    return layout.kind == "landmarks" and bool(followed) and all(_NAME.fullmatch(name) for name in followed)


def has_mouth(layout: Layout) -> bool:
    """Whether the lips and the chin are among a layout's followed points."""
    return layout.names[-len(_MOUTH_NAMES) :] == _MOUTH_NAMES


def inner_outline(layout: Layout) -> NDArray[np.int64]:
    """Numbers of the inner lips' points, the upper lip from corner to corner, then the lower one back; none without a mouth."""
    if not has_mouth(layout):
        return np.zeros(0, np.int64)
    upper, lower = np.split(layout.group("lips_inner"), [MOUTH_ROWS["upper_inner"]])
    return np.concatenate([upper, lower[::-1]])


def picture_points(frames: NDArray[np.float32]) -> NDArray[np.float64]:
    """Frames [T, 2 K] of a motion, whose y points up, to points [T, K, 2] px, y down as in pictures."""
    return frames.reshape(len(frames), -1, 2).astype(np.float64) * [1, -1]


def motion_frames(points: NDArray[np.float64]) -> NDArray[np.float32]:
    """The inverse of `picture_points`."""
    return (points * [1, -1]).reshape(len(points), -1).astype(np.float32)
