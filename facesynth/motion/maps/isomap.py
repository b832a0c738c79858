"""Isomap with landmarks: a cloud of poses unrolled into the plane along itself (Tenenbaum, de Silva, Langford 2000).

Distance along the cloud is the length of the shortest way from neighbour to neighbour. Classical scaling finds the points of
the plane whose distances are nearest to those, from all pairs; with landmarks (de Silva & Tenenbaum 2003), from the distances
to a few of the points alone:

    Y = -1/2 L# (D² - mean D²),    L# = Λ^-1/2 V',

V and Λ the leading eigenvectors and eigenvalues of the doubly centred squared distances between the landmarks, D² those from a
point to the landmarks, the mean taken over the landmarks. The same formula places points that came later.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

from facesynth.inference.arrays import Floats, Ints
from facesynth.inference.errors import FacesynthError

NEIGHBOURS = 12
"""Deng & Neumann 2008, §4."""
LANDMARKS = 100
CORE = 6000
"""Points of which the ways are made; of a larger cloud every n-th, the others are placed beside them."""


@dataclass(frozen=True, eq=False)
class Isomap:
    """A plane that new points can be placed into."""

    core: Floats
    """[M, D] points of which the ways are made."""
    ways: Floats
    """[M, L] lengths of the shortest ways from each of them to the landmarks."""
    mean_squared: Floats
    """[L] mean over the landmarks of their squared ways to each landmark."""
    inverse: Floats
    """[2, L] L# of the formula."""
    neighbours: int

    @classmethod
    def fit(cls, points: ArrayLike, *, neighbours: int = NEIGHBOURS, landmarks: int = LANDMARKS, core: int = CORE) -> Self:
        """Learn from points [N, D], N > neighbours; the landmarks lie evenly in their order, so that fits repeat."""
        cloud = np.asarray(points, np.float64)
        if cloud.ndim != 2 or len(cloud) <= max(neighbours, 2) or not np.isfinite(cloud).all():
            raise FacesynthError(
                f"a map of {neighbours} neighbours needs more points than that, [N, D] and finite; got shape {cloud.shape}"
            )
        cloud = cloud[evenly(len(cloud), core)]
        marks = evenly(len(cloud), landmarks)
        ways = dijkstra(neighbour_graph(cloud, neighbours), directed=False, indices=marks)  # [L, M]
        squared = ways[:, marks] ** 2
        centred = -0.5 * (squared - squared.mean(axis=0) - squared.mean(axis=1)[:, None] + squared.mean())
        values, vectors = np.linalg.eigh(centred)
        leading = np.argsort(values)[::-1][:2]
        values, vectors = np.maximum(values[leading], 1e-12 * max(abs(values).max(), 1e-300)), vectors[:, leading]
        vectors = vectors * np.where(vectors[np.abs(vectors).argmax(axis=0), [0, 1]] < 0, -1.0, 1.0)
        return cls(cloud, ways.T, squared.mean(axis=0), vectors.T / np.sqrt(values)[:, None], neighbours)

    @cached_property
    def places(self) -> Floats:
        """[M, 2] where the points of the core lie."""
        return self._embedded(self.ways)

    def place(self, points: ArrayLike) -> Floats:
        """[n, 2] where new points [n, D] lie: their ways lead over their nearest neighbours in the core."""
        cloud = np.asarray(points, np.float64).reshape(-1, self.core.shape[1])
        if not len(cloud):
            return np.zeros((0, 2))
        lengths, which = nearest(cloud, self.core, self.neighbours)
        ways = np.full((len(cloud), self.ways.shape[1]), np.inf)
        for k in range(self.neighbours):
            ways = np.minimum(ways, lengths[:, k, None] + self.ways[which[:, k]])
        return self._embedded(ways)

    def _embedded(self, ways: Floats) -> Floats:
        return -0.5 * (ways**2 - self.mean_squared) @ self.inverse.T


def evenly(count: int, most: int) -> Ints:
    """At most so many of `count` places, evenly."""
    return np.unique(np.linspace(0, count - 1, min(most, count)).round().astype(np.int64))


def nearest(points: Floats, cloud: Floats, count: int) -> tuple[Floats, Ints]:
    """[n, count] distances to the nearest of a cloud [M, D], and which they are, in rising order."""
    lengths, which = cKDTree(cloud).query(points, k=[*range(1, count + 1)])
    return np.asarray(lengths), np.asarray(which, np.int64)


def neighbour_graph(cloud: Floats, neighbours: int) -> csr_matrix:
    """[M, M] lengths of the steps between neighbours; parts that do not hang together are tied at their nearest points."""
    lengths, which = nearest(cloud, cloud, neighbours + 1)
    steps = [(np.repeat(np.arange(len(cloud)), neighbours + 1), which.ravel(), lengths.ravel())]
    count, part = connected_components(_graph(steps, len(cloud)), directed=False)
    members = [np.flatnonzero(part == k) for k in range(count)]
    for k, here in enumerate(members):
        for there in members[k + 1 :]:
            length, near = nearest(cloud[here], cloud[there], 1)
            best = int(length.argmin())
            steps.append((here[[best]], there[near[best]], length[best]))
    return _graph(steps, len(cloud))


def _graph(steps: list[tuple[Ints, Ints, Floats]], count: int) -> csr_matrix:
    """A way of no length is one, too, which a sparse matrix would pass over: it gets the least that is none."""
    row, column, length = (np.concatenate(part) for part in zip(*steps, strict=True))
    other = row != column
    length = np.maximum(length[other], np.finfo(np.float64).tiny)
    row, column = row[other], column[other]
    both = np.concatenate([row, column]), np.concatenate([column, row])
    order = np.lexsort((*both,))
    first = np.concatenate([[True], (np.diff(both[0][order]) != 0) | (np.diff(both[1][order]) != 0)])
    length = np.concatenate([length, length])[order][first]
    return csr_matrix((length, (both[0][order][first], both[1][order][first])), (count, count))


def residual_variance(ways: Floats, places: Floats) -> float:
    """1 - R² between distances along the cloud [N, N] and those of the points in the plane [N, 2]: 0 of a perfect map."""
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    return float(1 - np.corrcoef(ways.ravel(), apart.ravel())[0, 1] ** 2)
