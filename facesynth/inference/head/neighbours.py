"""The nearest points of a set, exactly: a k-d partition, of which the leaves with the nearest boxes are searched."""

import numpy as np

from ..arrays import Floats, Ints
from ..errors import FacesynthError

LEAF = 64
"""Largest number of points in a leaf."""


class Neighbours:
    """Points [N, D], ready to be asked."""

    def __init__(self, points: Floats) -> None:
        leaves = _leaves(points, np.arange(len(points), dtype=np.int64))
        self._order = np.concatenate(leaves)
        self._points = points[self._order]
        self._sizes = np.array([len(leaf) for leaf in leaves])
        self._starts = np.cumsum(self._sizes) - self._sizes
        self._low = np.stack([points[leaf].min(axis=0) for leaf in leaves])
        self._high = np.stack([points[leaf].max(axis=0) for leaf in leaves])

    def nearest(self, queries: Floats, count: int) -> tuple[Floats, Ints]:
        """Distances and indices [T, count] of the nearest points of queries [T, D], nearest first; equal ones in their order."""
        if not 0 < count <= len(self._points):
            raise FacesynthError(
                f"{count} neighbours of {len(self._points)} recorded frames are wanted; want fewer, or record more"
            )
        found = [self._of(query, count) for query in queries]
        return np.array([d for d, _ in found]).reshape(-1, count), np.array([i for _, i in found], np.int64).reshape(-1, count)

    # Friedman et al. 1977: no point of a leaf is nearer than its box. The leaves with the nearest boxes that hold enough points
    # give a distance; whatever is nearer than that lies in a leaf whose box is.
    def _of(self, query: Floats, count: int) -> tuple[Floats, Ints]:
        bound = np.square(np.maximum(0, np.maximum(self._low - query, query - self._high))).sum(axis=1)
        first = np.argsort(bound, kind="stable")
        enough = int(np.searchsorted(np.cumsum(self._sizes[first]), count)) + 1
        squares, _ = self._in(first[:enough], query)
        within = np.partition(squares, count - 1)[count - 1]
        squares, index = self._in(np.flatnonzero(bound <= within), query)
        order = np.lexsort((index, squares))[:count]
        return np.sqrt(squares[order]), index[order]

    def _in(self, leaves: Ints, query: Floats) -> tuple[Floats, Ints]:
        """Squared distances and indices of the points of some leaves."""
        sizes = self._sizes[leaves]
        at = np.arange(sizes.sum()) + np.repeat(self._starts[leaves] - np.cumsum(sizes) + sizes, sizes)
        return np.square(self._points[at] - query).sum(axis=1), self._order[at]


def _leaves(points: Floats, index: Ints) -> list[Ints]:
    """Halved at the median of the widest direction until few are left."""
    if len(index) <= LEAF:
        return [index]
    widest = int(np.ptp(points[index], axis=0).argmax())
    order = index[np.argsort(points[index, widest], kind="stable")]
    half = len(order) // 2
    return _leaves(points, order[:half]) + _leaves(points, order[half:])
