"""What phones before and after a position cost at least, for all nodes at once, from tables that are made once.

A class is the nodes of one phone in one emotion. Of every node the tables hold the least cost of a step to it from each class
that says the viseme of its captured predecessor, and the least cost of a step from it to each class; steps that were captured
(free) and steps from another viseme (PNT at least) are left out. 8 bits on a logarithmic scale, rounded down. The least phi of
a class plus the least cost of a step from that class to a node bounds the node's phi, and the same holds backwards.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..efase.costs import Weights
from ..efase.nodes import Nodes
from ..efase.steps import step_terms

TABLES = ("bounds_in", "bounds_out", "bounds_scale")
"""Names of the tables."""
NONE = 255
"""In a table: no such step."""
ROUNDING = 1 - 1e-6
"""Costs are lowered by this before they are coded, for they come from matrix products."""
COLUMNS = 256
"""Nodes to which steps are computed at once."""


def class_order(nodes: Nodes) -> Ints:
    """[N] nodes sorted by viseme, phone and emotion, so that each class is a range; alike ones as they were."""
    return np.lexsort((np.arange(len(nodes)), nodes.emotions, nodes.phones, nodes.visemes))


def class_starts(nodes: Nodes) -> Ints:
    """[C] first node of each class, of nodes in the order of `class_order`."""
    change = (np.diff(nodes.phones) != 0) | (np.diff(nodes.emotions) != 0)
    return np.concatenate([[0], np.flatnonzero(change) + 1]).astype(np.int64)


def step_bounds(nodes: Nodes, weights: Weights) -> dict[str, NDArray[Any]]:
    """The tables of a database, rows and columns in the order of `class_order`.

    bounds_in: for each viseme in turn [its classes, nodes whose predecessor says it], flat; bounds_out [C, N];
    bounds_scale [2]: lowest value and ratio of neighbouring ones, 0 in a table being 0.
    """
    nodes = nodes.take(class_order(nodes))
    first = class_starts(nodes)
    of_class = np.repeat(np.arange(len(first)), np.diff(np.append(first, len(nodes))))
    out = np.full((len(first), len(nodes)), np.inf, np.float32)
    coming = []
    preceding = np.where(nodes.before >= 0, nodes.visemes[nodes.before], -1)
    for viseme in np.unique(nodes.visemes):
        i, j = np.flatnonzero(nodes.visemes == viseme), np.flatnonzero(preceding == viseme)
        own = np.unique(of_class[i])
        table = np.full((len(own), len(j)), np.inf)
        by_length = np.argsort(nodes.lengths[nodes.before[j]], kind="stable")
        for some in np.split(by_length, range(COLUMNS, len(j), COLUMNS)) if len(j) else ():
            cost = steps_within(nodes, i, j[some], weights)
            table[:, some] = np.minimum.reduceat(cost, first[own] - i[0], axis=0)
            classes = of_class[j[some]]
            for number in np.unique(classes):
                out[number, i] = np.minimum(out[number, i], cost[:, classes == number].min(axis=1))
        coming.append(table.ravel())
    return dict(zip(TABLES, _coded(np.concatenate(coming), out), strict=True))


def steps_within(nodes: Nodes, i: Ints, j: Ints, weights: Weights) -> Floats:
    """[n, m] costs of steps within a viseme; infinite where they were captured."""
    terms = step_terms(nodes, i, j)
    return np.where(terms.captured > 0, np.inf, terms.cost(0.0, 0.0, weights.beta, weights.eta))


def _coded(coming: Floats, out: NDArray[np.float32]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    known = np.concatenate([table[np.isfinite(table) & (table > 0)].ravel() for table in (coming, out)])
    lowest, highest = (float(known.min()), float(known.max())) if len(known) else (1.0, 1.0)
    ratio = max((highest / lowest) ** (1 / (NONE - 3)), 1 + 1e-6)
    return coded(coming, lowest, ratio), coded(out, lowest, ratio), np.array([lowest, ratio])


def coded(costs: NDArray[np.floating[Any]], lowest: float, ratio: float) -> NDArray[np.uint8]:
    """Costs as they stand in a table, rounded down; infinite ones are NONE."""
    finite = np.isfinite(costs)
    with np.errstate(divide="ignore"):
        steps = np.floor(np.log(np.where(finite, costs, 1.0) * ROUNDING / lowest) / np.log(ratio))
    return np.where(finite, np.clip(steps + 1, 0, NONE - 1), NONE).astype(np.uint8)


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
    """Bounds from tables, over nodes in the order of `class_order`."""

    def __init__(self, nodes: Nodes, weights: Weights, tables: Mapping[str, NDArray[Any]]) -> None:
        self.nodes, self.weights = nodes, weights
        self.class_starts = class_starts(nodes)
        self.class_of = np.repeat(np.arange(len(self.class_starts)), np.diff(np.append(self.class_starts, len(nodes))))
        lowest, ratio = tables["bounds_scale"].tolist()
        self._values = np.concatenate([[0.0], lowest * ratio ** np.arange(NONE - 1), [np.inf]]).astype(np.float32)
        self._leaving = tables["bounds_out"]
        self._arrivals = list(self._tables(tables["bounds_in"]))
        self._orphans = nodes.before < 0

    def _tables(self, coded: NDArray[np.uint8]) -> Iterator[Arrivals]:
        nodes, at = self.nodes, 0
        first = nodes.visemes[self.class_starts]
        preceding = np.where(nodes.before >= 0, nodes.visemes[nodes.before], -1)
        for viseme in np.unique(first).tolist():
            own, reached = np.flatnonzero(first == viseme), np.flatnonzero(preceding == viseme)
            size = len(own) * len(reached)
            least = self._values[coded[at : at + size]].reshape(len(own), len(reached))
            yield Arrivals(slice(int(own[0]), int(own[-1]) + 1), reached, least)
            at += size

    def forward(self, phi: Floats) -> Floats:
        """[N] at least min over i of phi(i) + TC(i, j), where phi [N] is a bound itself."""
        w, by_class = self.weights, np.minimum.reduceat(phi, self.class_starts)
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
        after = self.nodes.after[i]
        return after[after >= 0]

    def backward(self, j: Ints, value: Floats, i: Ints) -> Floats:
        """[n] at least min over the nodes j [m] of TC(i, j) + value(j), for the nodes i [n]."""
        nodes, w, none = self.nodes, self.weights, np.inf
        by_class = np.full(len(self.class_starts), none)
        np.minimum.at(by_class, self.class_of[j], value)
        some = np.flatnonzero(by_class < none)
        least, orphan = value.min(), value[self._orphans[j]].min(initial=none)
        bound = np.full(len(i), min(least + w.pnt, orphan + w.alpha * w.pnt))
        above = (by_class[some] - least).astype(np.float32)
        bound = np.minimum(bound, (self._values[self._leaving[some[:, None], i]] + above[:, None]).min(axis=0) + least)
        of = np.full(len(nodes) + 1, none)
        of[j] = value
        return np.minimum(bound, of[nodes.after[i]])
