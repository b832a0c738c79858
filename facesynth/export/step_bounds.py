"""What a step of eFASE's path costs at least, by classes of nodes: small tables that let a search without numba pass over
nearly all of a database.

A class is the nodes of one phone in one emotion. Of every node the tables hold the least cost of a step to it from each
class that says the viseme of its captured predecessor, and the least cost of a step from it to each class; steps that were
captured (free) and steps from another viseme (PNT at least) are left out. 8 bits on a logarithmic scale, rounded down.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from facesynth.methods.efase.costs import Weights
from facesynth.methods.efase.nodes import Floats, Ints, MotionNodes
from facesynth.methods.efase.steps import CostWeights, step_terms
from facesynth.progress import track

COLUMNS = 256
"""Nodes to which steps are computed at once."""
ROUNDING = 1 - 1e-6
NONE = 255
"""In a table: no such step."""


def class_order(nodes: MotionNodes) -> Ints:
    """[N] nodes sorted by viseme, phone and emotion, so that each class is a range."""
    return np.lexsort((np.arange(len(nodes)), nodes.emotions, nodes.phones, nodes.visemes))


def sorted_nodes(nodes: MotionNodes, order: Ints) -> MotionNodes:
    """The same nodes in another order."""
    place = np.full(len(nodes) + 1, -1, np.int64)
    place[order] = np.arange(len(order))
    columns = {name: getattr(nodes, name)[order] for name in ("starts", "stops", "phones", "visemes", "emotions")}
    return replace(nodes, **columns, before=place[nodes.before[order]], after=place[nodes.after[order]])


def step_bounds(nodes: MotionNodes, weights: Weights) -> dict[str, NDArray[np.generic]]:
    """Tables of nodes in the order of `class_order`.

    bounds_in: for each viseme in turn [its classes, nodes whose predecessor says it], flat; bounds_out [C, N];
    bounds_scale [2]: lowest value and ratio of neighbouring ones, 0 in a table being 0.
    """
    first = class_starts(nodes)
    of_class = np.repeat(np.arange(len(first)), np.diff(np.append(first, len(nodes))))
    out = np.full((len(first), len(nodes)), np.inf, np.float32)
    coming = []
    preceding = np.where(nodes.before >= 0, nodes.visemes[nodes.before], -1)
    for viseme in track(np.unique(nodes.visemes), "bounding steps"):
        i, j = np.flatnonzero(nodes.visemes == viseme), np.flatnonzero(preceding == viseme)
        own = np.unique(of_class[i])
        table = np.full((len(own), len(j)), np.inf)
        by_length = np.argsort(nodes.lengths[nodes.before[j]], kind="stable")
        for some in np.split(by_length, range(COLUMNS, len(j), COLUMNS)) if len(j) else ():
            cost = _steps(nodes, i, j[some], weights)
            table[:, some] = np.minimum.reduceat(cost, first[own] - i[0], axis=0)
            classes = of_class[j[some]]
            for number in np.unique(classes):
                out[number, i] = np.minimum(out[number, i], cost[:, classes == number].min(axis=1))
        coming.append(table.ravel())
    return _coded(np.concatenate(coming), out)


def class_starts(nodes: MotionNodes) -> Ints:
    """[C] first node of each class."""
    change = (np.diff(nodes.phones) != 0) | (np.diff(nodes.emotions) != 0)
    return np.concatenate([[0], np.flatnonzero(change) + 1]).astype(np.int64)


def _steps(nodes: MotionNodes, i: Ints, j: Ints, weights: Weights) -> Floats:
    """[n, m] costs of steps within a viseme; infinite where they were captured."""
    terms = step_terms(nodes, i, j)
    cost = terms.cost(CostWeights(0.0, 0.0, weights.beta, weights.eta)).numpy()
    return np.where(terms.captured.numpy() > 0, np.inf, cost)


def _coded(coming: Floats, out: NDArray[np.float32]) -> dict[str, NDArray[np.generic]]:
    known = np.concatenate([table[np.isfinite(table) & (table > 0)].ravel() for table in (coming, out)])
    lowest, highest = (float(known.min()), float(known.max())) if len(known) else (1.0, 1.0)
    ratio = max((highest / lowest) ** (1 / (NONE - 3)), 1 + 1e-6)

    def code(table: NDArray[np.floating]) -> NDArray[np.uint8]:
        finite = np.isfinite(table)
        with np.errstate(divide="ignore"):
            steps = np.floor(np.log(np.where(finite, table, 1.0) * ROUNDING / lowest) / np.log(ratio))
        return np.where(finite, np.clip(steps + 1, 0, NONE - 1), NONE).astype(np.uint8)

    return {"bounds_in": code(coming), "bounds_out": code(out), "bounds_scale": np.array([lowest, ratio])}
