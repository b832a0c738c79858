"""A forest of ball trees over the end vectors of the nodes, one tree for each (phone, emotion).

All members of one tree cost the same as an answer to any phone of the input, so a whole tree can be
passed over at once. Inside a tree, `min phi + (‖start - centre‖ - radius)²` bounds what its members
can offer to a successor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from facesynth.methods.efase.nodes import Floats, Ints

LEAF = 8
"""Members of a leaf at the most."""


@dataclass(frozen=True, eq=False)
class Forest:
    """B balls in C trees over N members; children of a ball have larger numbers than the ball."""

    order: Ints
    """[N] members, so that each ball is a range of this array."""
    starts: Ints
    """[B] first place of a ball in `order`."""
    stops: Ints
    """[B] one past its last place."""
    left: Ints
    """[B] first child, or -1 for a leaf; the second child is `right`."""
    right: Ints
    centres: Floats
    """[B, V] middle of the ball."""
    radii: Floats
    """[B] distance from the middle to the farthest member."""
    roots: Ints
    """[C + 1] first ball of each tree and, last, B."""
    tree_of: Ints
    """[N] the tree of each member."""


def grow_forest(vectors: Floats, tree_of: Ints) -> Forest:
    """Split each class of members at the median of its widest coordinate until LEAF remain.

    vectors [N, V], tree_of [N] numbers of classes 0 … C-1, none empty.
    """
    classes = int(tree_of.max()) + 1
    order = np.argsort(tree_of, kind="stable").astype(np.int64)
    bounds = np.searchsorted(tree_of[order], np.arange(classes + 1)).astype(np.int64)
    capacity = 4 * (len(order) // LEAF + classes) + 4
    starts, stops, left, right, roots, count = _split_all(vectors, order, bounds, capacity)
    starts, stops, left, right = starts[:count], stops[:count], left[:count], right[:count]
    centres, radii = _enclose(vectors, order, starts, stops)
    return Forest(order, starts, stops, left, right, centres, radii, roots, tree_of.astype(np.int64))


@njit(cache=True)
def _split_all(vectors, order, bounds, capacity):  # type: ignore[no-untyped-def]
    starts, stops = np.empty(capacity, np.int64), np.empty(capacity, np.int64)
    left, right = np.full(capacity, -1), np.full(capacity, -1)
    roots = np.empty(len(bounds), np.int64)
    count = 0
    for tree in range(len(bounds) - 1):
        roots[tree] = count
        starts[count], stops[count] = bounds[tree], bounds[tree + 1]
        ball = count
        count += 1
        while ball < count:
            a, b = starts[ball], stops[ball]
            if b - a > LEAF:
                members = order[a:b].copy()
                axis = _widest(vectors, members)
                order[a:b] = members[np.argsort(vectors[members, axis], kind="mergesort")]
                middle = (a + b) // 2
                left[ball], right[ball] = count, count + 1
                starts[count], stops[count] = a, middle
                starts[count + 1], stops[count + 1] = middle, b
                count += 2
            ball += 1
    roots[-1] = count
    return starts, stops, left, right, roots, count


@njit(cache=True)
def _widest(vectors, members):  # type: ignore[no-untyped-def]
    best, axis = -1.0, 0
    for v in range(vectors.shape[1]):
        low, high = np.inf, -np.inf
        for m in members:
            low, high = min(low, vectors[m, v]), max(high, vectors[m, v])
        if high - low > best:
            best, axis = high - low, v
    return axis


@njit(cache=True)
def _enclose(vectors, order, starts, stops):  # type: ignore[no-untyped-def]
    balls, width = len(starts), vectors.shape[1]
    centres, radii = np.zeros((balls, width)), np.zeros(balls)
    for ball in range(balls):
        members = order[starts[ball] : stops[ball]]
        for m in members:
            centres[ball] += vectors[m]
        centres[ball] /= len(members)
        for m in members:
            distance = 0.0
            for v in range(width):
                distance += (vectors[m, v] - centres[ball, v]) ** 2
            radii[ball] = max(radii[ball], distance)
        radii[ball] = np.sqrt(radii[ball])
    return centres, radii
