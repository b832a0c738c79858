"""The triangles over tracked points, and a still ring around them that keeps the rest of the picture in place."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, Delaunay, QhullError

from facesynth.inference.errors import FacesynthError

RING_POINTS = 32
RING_DISTANCE = 0.25
"""How far outside the points the ring lies, in radii of their hull."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """K moving points, a ring of R still ones, and triangles over both, made once on the mean shape."""

    reference: NDArray[np.float64]
    """[K + R, 2] (x, y) in px: pixel (row i, column j) has its centre at x = j, y = i."""
    triangles: NDArray[np.int64]
    """[F, 3] vertex numbers, all turning the same way on the reference."""
    moving: int
    """K: the first vertices move, the others are the ring."""

    def vertices(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points [..., K, 2] with the ring behind them: [..., K + R, 2]."""
        ring = np.broadcast_to(self.reference[self.moving :], (*points.shape[:-2], len(self.reference) - self.moving, 2))
        return np.concatenate([points, ring], axis=-2)

    @property
    def opacity(self) -> NDArray[np.float64]:
        """[K + R] 1 at moving points, 0 at the ring: interpolated over the triangles it is a soft border."""
        return (np.arange(len(self.reference)) < self.moving).astype(np.float64)

    def folded(self, vertices: NDArray[np.float64]) -> NDArray[np.int64]:
        """How many triangles of vertices [..., K + R, 2] are turned over or without area: [...]."""
        return (signed_areas(vertices, self.triangles) <= 1e-9).sum(axis=-1)


def ringed_mesh(points: NDArray[np.float64]) -> Mesh:
    """The Delaunay mesh of points [K, 2] and an elliptic ring around them."""
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < 3 or not np.isfinite(points).all():
        raise FacesynthError(f"a mesh needs at least 3 points [K, 2] without NaN; got shape {points.shape}")
    try:
        hull = points[ConvexHull(points).vertices]
    except QhullError:
        raise FacesynthError(f"the {len(points)} points lie on one line; a mesh needs an area") from None
    centre = (hull.min(axis=0) + hull.max(axis=0)) / 2
    radii = (hull.max(axis=0) - hull.min(axis=0)) / 2
    angles = 2 * np.pi * np.arange(RING_POINTS) / RING_POINTS
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    # The least ellipse of these proportions that holds the hull, and then some.
    reach = np.linalg.norm((hull - centre) / radii, axis=1).max()
    return mesh_of(points, centre + (reach + RING_DISTANCE) * radii * circle)


def mesh_of(points: NDArray[np.float64], ring: NDArray[np.float64]) -> Mesh:
    """The Delaunay mesh of moving points [K, 2] and still ones [R, 2]."""
    reference = np.concatenate([points, ring]).astype(np.float64)
    triangles = Delaunay(reference).simplices.astype(np.int64)
    turned = signed_areas(reference, triangles) < 0
    triangles[turned] = triangles[turned][:, ::-1]
    return Mesh(reference, triangles, len(points))


def signed_areas(vertices: NDArray[np.float64], triangles: NDArray[np.int64]) -> NDArray[np.float64]:
    """[..., F] areas in px², negative for triangles turned over, of vertices [..., V, 2]."""
    a, b, c = (vertices[..., triangles[:, corner], :] for corner in range(3))
    return ((b - a)[..., 0] * (c - a)[..., 1] - (b - a)[..., 1] * (c - a)[..., 0]) / 2
