"""Points of a map as a surface: a picture of where they lie, and poses between them.

The picture (Deng & Neumann 2008, eq. 3): each pixel sums Gaussians about the points, `sum N(Q_i, sigma; distance) rho I(Q_i)`,
in the colour of each point; where that is brighter than one, its brightest part is one and the hue stays. Between the points,
triangles (Delaunay): a place within one stands for the mean of its three corners by barycentric coordinates; a place outside of
all stands for nothing.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import Delaunay, QhullError, cKDTree

from facesynth.inference.arrays import Floats, Ints
from facesynth.inference.filters import gaussian

RHO = 0.35
"""Brightness of one point at its own place."""
SIGMA = 0.012
"""Spread of a point, as a share of the map's longer side."""


@dataclass(frozen=True, eq=False)
class Mixed:
    """Places [n] of a map as means of its points."""

    corners: Ints
    """[n, 3] which points."""
    shares: Floats
    """[n, 3] of each, not negative, sum 1."""
    inside: NDArray[np.bool_]
    """[n] whether a triangle covers the place; where none does, the nearest point stands alone."""

    def of(self, frames: NDArray[np.floating]) -> Floats:
        """[n, D] the means of what the points stand for, frames [N, D]."""
        return np.einsum("nk,nkd->nd", self.shares, frames[self.corners].astype(np.float64))


@dataclass(frozen=True, eq=False)
class Plane:
    """Points [N, 2] of a map."""

    points: Floats

    @cached_property
    def triangles(self) -> Delaunay | None:
        """None where fewer than three points lie apart, or all on a line."""
        try:
            return Delaunay(self.points) if len(self.points) > 2 else None
        except QhullError:
            return None

    @cached_property
    def tree(self) -> cKDTree:
        """For the nearest point."""
        return cKDTree(self.points)

    @property
    def box(self) -> tuple[Floats, Floats]:
        """[2] lower left and [2] upper right corner, a little around all points."""
        low, high = self.points.min(axis=0), self.points.max(axis=0)
        margin = 0.04 * max(float((high - low).max()), 1e-9)
        return low - margin, high + margin

    def mixed(self, places: ArrayLike) -> Mixed:
        """What places [n, 2] stand for."""
        at = np.asarray(places, np.float64).reshape(-1, 2)
        _, near = self.tree.query(at)
        corners, shares = np.repeat(np.asarray(near, np.int64)[:, None], 3, axis=1), np.tile([1.0, 0.0, 0.0], (len(at), 1))
        inside = np.zeros(len(at), bool)
        if self.triangles is not None:
            which = self.triangles.find_simplex(at)
            inside = which >= 0
            affine = self.triangles.transform[which[inside]]
            two = np.einsum("nij,nj->ni", affine[:, :2], at[inside] - affine[:, 2])
            corners[inside] = self.triangles.simplices[which[inside]]
            shares[inside] = _shares(np.column_stack([two, 1 - two.sum(axis=1)]))
        return Mixed(corners, shares, inside)

    def extent(self, size: tuple[int, int]) -> tuple[float, float, float, float]:
        """Left, right, bottom and top of a picture of `size` pixels (width, height) that shows the whole map, undistorted."""
        low, high = self.box
        centre, half = (low + high) / 2, np.array(size) / 2 * max((high - low) / np.array(size))
        return (*(float(v) for pair in zip(centre - half, centre + half, strict=True) for v in pair),)  # type: ignore[return-value]

    def picture(
        self, colours: ArrayLike, size: tuple[int, int], *, rho: float = RHO, sigma: float = SIGMA
    ) -> NDArray[np.float32]:
        """[height, width, 3] brightness 0..1 of the points in their colours [N, 3]; size in pixels, the map's top row first."""
        width, height = size
        left, right, bottom, top = self.extent(size)
        column = np.clip(((self.points[:, 0] - left) / (right - left) * width).astype(np.int64), 0, width - 1)
        row = np.clip(((top - self.points[:, 1]) / (top - bottom) * height).astype(np.int64), 0, height - 1)
        field = np.zeros((height, width, 3))
        np.add.at(field, (row, column), rho * np.asarray(colours, np.float64))
        spread = max(sigma * max(size), 0.3)
        for _ in range(2):  # along the columns, then along the rows; N is 1 at its centre
            smooth = np.stack([gaussian(field[..., k], spread) for k in range(3)], axis=-1)
            field = smooth.transpose(1, 0, 2) * spread * np.sqrt(2 * np.pi)
        return (np.maximum(field, 0) / np.maximum(field.max(axis=2, keepdims=True), 1)).astype(np.float32)


def _shares(shares: Floats) -> Floats:
    """Rounding may leave a place on an edge a little outside; flat triangles have no coordinates at all."""
    shares = np.clip(np.nan_to_num(shares, nan=1 / 3), 0, 1)
    return shares / shares.sum(axis=1, keepdims=True)
