"""What phones before and after a position cost at least, for all nodes at once, from tables that came with the database.

A class is the nodes of one phone in one emotion; nodes are sorted so that each class is a range. The least phi of a class
plus the least cost of a step from that class to a node bounds the node's phi, and the same holds backwards.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..efase.nodes import Floats, Ints, Nodes

NONE = 255
"""In a table: no such step."""


@dataclass(frozen=True, eq=False)
class Arrivals:
    """Steps to the nodes whose captured predecessors say one viseme."""

    classes: slice
    """The classes of that viseme."""
    nodes: Ints
    """[m]"""
    least: NDArray[np.float32]
    """[c, m] least cost of a step from each of these classes to each of these nodes."""


class StepBounds:
    """The tables of `facesynth export`."""

    def __init__(self, nodes: Nodes, arrays: Mapping[str, NDArray[Any]]) -> None:
        self.nodes = nodes
        lowest, ratio = arrays["bounds_scale"].tolist()
        self._values = np.concatenate([[0.0], lowest * ratio ** np.arange(NONE - 1), [np.inf]]).astype(np.float32)
        self._leaving = arrays["bounds_out"]
        self._arrivals = list(self._tables(arrays["bounds_in"]))
        self._after = np.full(len(nodes), -1, np.int64)
        followers = np.flatnonzero(nodes.before >= 0)
        self._after[nodes.before[followers]] = followers
        self._orphans = nodes.before < 0

    def _tables(self, coded: NDArray[np.uint8]) -> Any:
        nodes, at = self.nodes, 0
        first = nodes.visemes[nodes.class_starts]
        preceding = np.where(nodes.before >= 0, nodes.visemes[nodes.before], -1)
        for viseme in np.unique(first).tolist():
            own, reached = np.flatnonzero(first == viseme), np.flatnonzero(preceding == viseme)
            size = len(own) * len(reached)
            least = self._values[coded[at : at + size]].reshape(len(own), len(reached))
            yield Arrivals(slice(int(own[0]), int(own[-1]) + 1), reached, least)
            at += size

    def forward(self, phi: Floats) -> Floats:
        """[N] at least min over i of phi(i) + TC(i, j), where phi [N] is a bound itself."""
        w, by_class = self.nodes.weights, np.minimum.reduceat(phi, self.nodes.class_starts)
        least = by_class.min()
        above = (by_class - least).astype(np.float32)
        alike = np.full(len(phi), np.inf, np.float32)
        for group in self._arrivals:
            if len(group.nodes):
                alike[group.nodes] = (group.least + above[group.classes, None]).min(axis=0)
        bound = np.minimum(np.minimum(alike, w.pnt) + least, phi[self.nodes.before])
        bound[self._orphans] = least + w.alpha * w.pnt
        return bound

    def following(self, i: Ints) -> Ints:
        """The nodes that were recorded right after the nodes i."""
        after = self._after[i]
        return after[after >= 0]

    def backward(self, j: Ints, value: Floats, i: Ints) -> Floats:
        """[n] at least min over the nodes j [m] of TC(i, j) + value(j), for the nodes i [n]."""
        nodes, w, none = self.nodes, self.nodes.weights, np.inf
        by_class = np.full(len(nodes.class_starts), none)
        np.minimum.at(by_class, nodes.class_of[j], value)
        some = np.flatnonzero(by_class < none)
        least, orphan = value.min(), value[self._orphans[j]].min(initial=none)
        bound = np.full(len(i), min(least + w.pnt, orphan + w.alpha * w.pnt))
        above = (by_class[some] - least).astype(np.float32)
        bound = np.minimum(bound, (self._values[self._leaving[some[:, None], i]] + above[:, None]).min(axis=0) + least)
        after = self._after[i]
        of = np.full(len(nodes) + 1, none)
        of[j] = value
        return np.minimum(bound, of[after])
