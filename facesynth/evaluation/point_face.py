"""A face drawn from its points alone: any layout has one, whoever recorded it. Curves are drawn as bars."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from facesynth.evaluation.pair import Array
from facesynth.inference.layout import Layout

SKIN = np.array([205.0, 190.0, 178.0])
MOUTH = np.array([70.0, 25.0, 30.0])
PAPER = (250, 250, 248)
INK = (40, 40, 46)
BARS = 26
"""Curves drawn: those that move most."""
SMOOTH = 2
"""Pictures are drawn so many times larger and shrunk, for smooth edges."""


@dataclass(frozen=True, eq=False)
class PointFace:
    """How to draw frames of one layout."""

    layout: Layout
    rest: Array
    """[K, dimension]"""
    triangles: NDArray[np.int64]
    """[F, 3] points; none for curves."""
    mouth: NDArray[np.bool_]
    """[F] triangles between the inner lips."""
    bars: NDArray[np.int64]
    """Curves that are drawn as bars; none for points."""

    @classmethod
    def of(cls, layout: Layout, frames: Array) -> Self:
        """From recorded frames [T, C]: their mean is the shape at rest where the layout states none."""
        mean = np.nanmean(frames, axis=0)
        rest = layout.points(np.asarray(mean if layout.neutral is None else layout.neutral, np.float64))
        if layout.kind == "curves":
            moving = np.argsort(-np.nanstd(frames, axis=0), kind="stable")[:BARS]
            return cls(layout, rest, np.zeros((0, 3), np.int64), np.zeros(0, bool), np.sort(moving))
        triangles = _triangles(rest[:, :2])
        inner = set(map(int, layout.groups.get("lips_inner", ())))
        mouth = np.array([inner.issuperset(map(int, triangle)) for triangle in triangles], bool)
        return cls(layout, rest, triangles, mouth, np.zeros(0, np.int64))

    def picture(self, frame: Array, size: tuple[int, int], error: Array | None = None, worst: float = 1.0) -> NDArray[np.uint8]:
        """One frame [C] as pixels [height, width, 3]; `error` [K] colours it, dark red from `worst` on."""
        from PIL import Image, ImageDraw

        width, height = size[0] * SMOOTH, size[1] * SMOOTH
        canvas = Image.new("RGB", (width, height), PAPER)
        pen = ImageDraw.Draw(canvas)
        if len(self.bars):
            self._draw_bars(pen, frame, (width, height), error, worst)
        else:
            self._draw_points(pen, self.layout.points(frame), (width, height), error, worst)
        return np.asarray(canvas.resize(size, Image.Resampling.LANCZOS))

    def _draw_points(self, pen, points: Array, size: tuple[int, int], error: Array | None, worst: float) -> None:  # type: ignore[no-untyped-def]
        at = self._pixels(points[:, :2], size)
        share = np.zeros(len(points)) if error is None else np.clip(error / worst, 0, 1)
        depth = points[self.triangles][..., 2].mean(axis=1) if points.shape[1] == 3 else np.zeros(len(self.triangles))
        light = self._light(points)
        for f in np.argsort(depth, kind="stable"):
            corners = self.triangles[f]
            colour = MOUTH if self.mouth[f] else heat(SKIN * light[f], float(share[corners].mean()))
            pen.polygon([tuple(at[k]) for k in corners], fill=tuple(int(c) for c in colour))
        for group in ("lips_inner", "lips_outer", "brows", "eyelids"):
            for k in self.layout.groups.get(group, ()):
                x, y = at[k]
                pen.ellipse((x - 2, y - 2, x + 2, y + 2), fill=INK)

    def _draw_bars(self, pen, frame: Array, size: tuple[int, int], error: Array | None, worst: float) -> None:  # type: ignore[no-untyped-def]
        width, height = size
        step, left = height / (len(self.bars) + 1), width * 0.08
        for row, k in enumerate(self.bars):
            colour = heat(SKIN * 0.8, 0.0 if error is None else float(np.clip(error[k] / worst, 0, 1)))
            top, long = (row + 0.6) * step, (width * 0.84) * float(np.clip(frame[k], 0, 1))
            pen.rectangle((left, top, left + width * 0.84, top + step * 0.7), outline=(225, 225, 222))
            pen.rectangle((left, top, left + long, top + step * 0.7), fill=tuple(int(c) for c in colour))

    def _pixels(self, points: Array, size: tuple[int, int]) -> Array:
        """[K, 2] pixel places; the box around the rest pose, with a margin, fills the picture."""
        low, high = self.rest[:, :2].min(axis=0), self.rest[:, :2].max(axis=0)
        scale = min(size[0] / (high[0] - low[0]), size[1] / (high[1] - low[1])) * 0.84
        centre = (low + high) / 2 - [0, 0.03 * (high[1] - low[1])]
        return (np.nan_to_num(points, nan=float(centre[0])) - centre) * [scale, -scale] + np.array(size) / 2

    def _light(self, points: Array) -> Array:
        """[F] brightness: more where a triangle faces the viewer and a little from above."""
        if points.shape[1] < 3:
            return np.ones(len(self.triangles))
        a, b, c = (points[self.triangles[:, k]] for k in range(3))
        normal = np.cross(b - a, c - a)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
        normal *= np.sign(normal[:, 2:])
        return 0.55 + 0.45 * np.clip(normal @ np.array([0.15, 0.35, 0.92]), 0, 1)


def heat(colour: Array, share: float) -> Array:
    """A colour [3] turned towards dark red by `share`, 0..1."""
    return colour + share * (np.array([165.0, 15.0, 21.0]) - colour)


def _triangles(places: Array) -> NDArray[np.int64]:
    """Delaunay triangles of [K, 2] without the long ones that only close the outline."""
    from scipy.spatial import Delaunay, QhullError

    try:
        triangles = Delaunay(places).simplices.astype(np.int64)
    except (QhullError, ValueError):
        return np.zeros((0, 3), np.int64)
    edges = np.linalg.norm(places[triangles] - places[np.roll(triangles, 1, axis=1)], axis=2).max(axis=1)
    return triangles[edges <= 6 * np.median(edges)]
