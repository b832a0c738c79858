"""The triangles over tracked points, and a still ring around them that keeps the rest of the picture in place."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.spatial import ConvexHull, Delaunay, QhullError

from facesynth.inference.errors import FacesynthError

RING_POINTS = 32
RING_DISTANCE = 0.25
"""How far outside the points the ring lies, in radii of their hull."""
LEAST_AREA = 0.03
"""Of a triangle, of its area on the reference: with less it counts as folded."""
RELAXING_ROUNDS = 100
FOLDED_SHARE = 0.03
"""Of the recorded shapes: where more of them fold a mesh, some of its points are no good."""
JUDGED_SHAPES = 500
FEWEST_POINTS = 8


@dataclass(frozen=True, eq=False)
class Mesh:
    """M moving points, a ring of R still ones, and triangles over both, made once on the mean shape."""

    reference: NDArray[np.float64]
    """[M + R, 2] (x, y) in px: pixel (row i, column j) has its centre at x = j, y = i."""
    triangles: NDArray[np.int64]
    """[F, 3] vertex numbers, all turning the same way on the reference."""
    moving: int
    """M: the first vertices move, the others are the ring."""
    used: NDArray[np.int64] | None = None
    """[M] numbers of the points that are vertices; None: all of them are, M = K."""

    def vertices(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Those of points [..., K, 2] that are used, with the ring behind them: [..., M + R, 2]."""
        ring = np.broadcast_to(self.reference[self.moving :], (*points.shape[:-2], len(self.reference) - self.moving, 2))
        return np.concatenate([points if self.used is None else points[..., self.used, :], ring], axis=-2)

    @property
    def opacity(self) -> NDArray[np.float64]:
        """[M + R] 1 at moving points, 0 at the ring: interpolated over the triangles it is a soft border."""
        return (np.arange(len(self.reference)) < self.moving).astype(np.float64)

    def folded(self, vertices: NDArray[np.float64]) -> NDArray[np.int64]:
        """How many triangles of vertices [..., M + R, 2] are turned over or without area: [...]."""
        return (signed_areas(vertices, self.triangles) <= 1e-9).sum(axis=-1)

    def unfolded(self, vertices: NDArray[np.float64]) -> NDArray[np.float64]:
        """Head-fixed vertices [T, M + R, 2] of which no triangle is turned over or nearly without area.

        Points that would fold a triangle take the mean displacement of their neighbours, again and again, until none does; a
        frame in which that does not end moves less as a whole. Frames without folds stay as they are.
        """
        out = vertices.copy()
        for frame in np.flatnonzero(self.narrow(vertices).any(axis=-1)):
            out[frame] = self.reference + self._relaxed(vertices[frame] - self.reference)
        return out

    def narrow(self, vertices: NDArray[np.float64]) -> NDArray[np.bool_]:
        """[..., F] triangles with less than LEAST_AREA of what they have on the reference."""
        least = LEAST_AREA * signed_areas(self.reference, self.triangles)
        return np.asarray(signed_areas(vertices, self.triangles) < least)

    def _relaxed(self, moved: NDArray[np.float64]) -> NDArray[np.float64]:
        """Displacements [M + R, 2] of one frame after relaxing."""
        around = self._around()
        for _ in range(RELAXING_ROUNDS):
            narrow = self.narrow(self.reference + moved)
            if not narrow.any():
                return moved
            corners = np.unique(self.triangles[narrow])
            corners = corners[corners < self.moving]
            moved = moved.copy()
            moved[corners] = around[corners] @ moved
        while self.narrow(self.reference + moved).any():
            moved = 0.8 * moved if np.abs(moved).max() > 1e-6 else np.zeros_like(moved)
        return moved

    def _around(self) -> csr_array:
        """[M + R, M + R] mean over each vertex and those that share a triangle with it."""
        pairs = np.concatenate([self.triangles[:, [i, j]] for i in range(3) for j in range(3)])
        count = len(self.reference)
        touching = csr_array((np.ones(len(pairs)), pairs.T), shape=(count, count))
        touching.data[:] = 1.0
        return csr_array(touching / np.asarray(touching.sum(axis=1))[:, None])


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


def mesh_without_folds(shapes: NDArray[np.float64], needed: NDArray[np.int64]) -> Mesh:
    """The mesh over shapes [N, K, 2] without the points that most often fold it: followed badly, or too close to others.

    Points are left out one by one, the one in most folded triangles first, until less than FOLDED_SHARE of the shapes fold;
    the `needed` ones stay.
    """
    shapes = shapes[np.unique(np.linspace(0, len(shapes) - 1, JUDGED_SHAPES).round().astype(int))]
    used = np.arange(shapes.shape[1])
    while True:
        plain = ringed_mesh(shapes[:, used].mean(axis=0))
        mesh = Mesh(plain.reference, plain.triangles, plain.moving, used)
        narrow = mesh.narrow(mesh.vertices(shapes))
        at_fault = np.zeros(len(mesh.reference))
        np.add.at(at_fault, mesh.triangles, narrow.sum(axis=0)[:, None])
        at_fault[mesh.moving :] = 0
        at_fault[: mesh.moving][np.isin(used, needed)] = 0
        if narrow.any(axis=1).mean() <= FOLDED_SHARE or not at_fault.any() or len(used) <= FEWEST_POINTS:
            return mesh
        used = np.delete(used, at_fault.argmax())


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
