"""Bounds of a database from which nodes were taken, and to which some were added that nobody recorded.

A least cost over more nodes is no higher than over fewer: what the tables of the whole database say of the nodes that are left
stays a bound. Steps from added nodes are computed and taken into the least; steps to them need no table, for they have no
captured predecessor. So the tables change in moments where making them takes seconds, and the search stays exact.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Ints
from ..efase.bounds import NONE, TABLES, class_order, class_starts, coded, steps_within
from ..efase.costs import Weights
from ..efase.nodes import Nodes

Codes = NDArray[np.uint8]
Rows = dict[tuple[int, int], Codes]
"""[N] of each class, by its phone and emotion."""


def changed_bounds(
    old: Nodes, tables: Mapping[str, NDArray[Any]], kept: Ints, new: Nodes, weights: Weights
) -> dict[str, NDArray[Any]]:
    """Tables of `step_bounds` for `new`, whose first nodes are the nodes `kept` [K] of `old`, and whose others were added."""
    coming, leaving = _by_class(old, tables)
    order = class_order(new)
    nodes, origin = new.take(order), np.concatenate([kept, np.full(len(new) - len(kept), -1)])[order]
    added = np.flatnonzero(origin < 0)
    first = class_starts(nodes)
    classes = [(int(nodes.phones[k]), int(nodes.emotions[k])) for k in first]
    preceding = np.where(nodes.before >= 0, nodes.visemes[nodes.before], -1)
    out = np.full((len(classes), len(nodes)), NONE, np.uint8)
    for c, name in enumerate(classes):
        if name in leaving:
            out[c] = np.where(origin >= 0, leaving[name][origin], NONE)
    of_class = np.repeat(np.arange(len(first)), np.diff(np.append(first, len(nodes))))
    rows, nothing = [], np.full(len(nodes), NONE, np.uint8)
    for viseme in np.unique(nodes.visemes).tolist():
        own = np.flatnonzero(nodes.visemes[first] == viseme)
        j = np.flatnonzero(preceding == viseme)
        table = np.stack([coming[classes[c]][origin[j]] if classes[c] in coming else nothing[j] for c in own])
        i = added[nodes.visemes[added] == viseme]
        if len(i) and len(j):
            costs = coded(steps_within(nodes, i, j, weights), *tables["bounds_scale"].tolist())  # [a, m]
            np.minimum.at(table, np.searchsorted(own, of_class[i]), costs)
            for c in np.unique(of_class[j]):
                out[c, i] = np.minimum(out[c, i], costs[:, of_class[j] == c].min(axis=1))
        rows.append(table.ravel())
    return dict(zip(TABLES, (np.concatenate(rows), out, tables["bounds_scale"]), strict=True))


def _by_class(old: Nodes, tables: Mapping[str, NDArray[Any]]) -> tuple[Rows, Rows]:
    """Codes of steps from each class to each node, and from each node to each class, [N] in the order of the database."""
    order = class_order(old)
    nodes, first = old.take(order), class_starts(old.take(order))
    preceding = np.where(nodes.before >= 0, nodes.visemes[nodes.before], -1)
    classes = [(int(nodes.phones[k]), int(nodes.emotions[k])) for k in first]
    coming, leaving, at = Rows(), Rows(), 0
    for c, name in enumerate(classes):
        leaving[name] = _in_order(tables["bounds_out"][c], order)
    for viseme in np.unique(nodes.visemes).tolist():
        j = np.flatnonzero(preceding == viseme)
        for c in np.flatnonzero(nodes.visemes[first] == viseme).tolist():
            row = np.full(len(nodes), NONE, np.uint8)
            row[j] = tables["bounds_in"][at : at + len(j)]
            coming[classes[c]] = _in_order(row, order)
            at += len(j)
    return coming, leaving


def _in_order(row: Codes, order: Ints) -> Codes:
    out = np.empty_like(row)
    out[order] = row
    return out
