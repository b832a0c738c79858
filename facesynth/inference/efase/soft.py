"""Every path counts, the cheaper the more: the search with its minimum replaced by a soft one, over some candidates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..efase.nodes import Floats, Ints, Nodes, Query
from ..posterior import posterior
from ..products import product
from ..warp import stretched


@dataclass(frozen=True, eq=False)
class Mixture:
    """The nodes that may stand at one phone, with their posterior probabilities."""

    nodes: Ints
    shares: Floats
    captured: float
    """Probability that the step into this phone was captured; 0 at the first phone."""


@dataclass(frozen=True, eq=False)
class Softness:
    """How the mean over paths is taken."""

    temperature: float
    limit: int
    """Candidates of each phone, that of the cheapest path not counted."""


def mixtures(nodes: Nodes, queries: Sequence[Query], path: Ints, softness: Softness) -> list[Mixture]:
    """One for each phone; `path` [T] is the cheapest one."""
    targets = [targets_of(nodes, query) for query in queries]
    after = np.full(len(nodes), -1, np.int64)
    after[nodes.before[nodes.before >= 0]] = np.flatnonzero(nodes.before >= 0)
    chosen = [_candidates(nodes, after, queries, targets[t], t, int(path[t]), softness) for t in range(len(queries))]
    tau = softness.temperature
    moves = [-step_matrix(nodes, i, j) / tau for i, j in pairwise(chosen)]
    scores = [-target[which] / tau for target, which in zip(targets, chosen, strict=True)]
    found, captured = posterior(scores, moves), [0.0]
    for t, (here, there) in enumerate(pairwise(chosen)):
        column = np.flatnonzero(np.isin(nodes.before[there], here))
        row = np.searchsorted(here, nodes.before[there[column]])
        captured.append(float(found.of_steps(t, row, column).sum()))
    return [Mixture(*parts) for parts in zip(chosen, found.shares(), captured, strict=True)]


def targets_of(nodes: Nodes, query: Query) -> Floats:
    """[N] target cost of every node, infinite where it is forbidden."""
    cost: Floats = nodes.class_targets(query)[nodes.class_of]
    if query.heard is not None:
        cost = cost + query.heard
    if query.node >= 0:
        cost = np.where(np.arange(len(nodes)) == query.node, cost, np.inf)
    return cost


def _candidates(
    nodes: Nodes, after: Ints, queries: Sequence[Query], target: Floats, t: int, own: int, softness: Softness
) -> Ints:
    """What looks cheapest before a step is known, and the node of the cheapest path; ties to fitting successors."""
    w, looks = nodes.weights, target.copy()
    if t:
        viseme = queries[t - 1].viseme
        other = nodes.visemes[nodes.before] != viseme if viseme >= 0 else np.zeros(len(nodes), bool)
        looks += np.where(nodes.before < 0, w.alpha, np.where(other, 1.0, 0.0)) * w.pnt
    follows = queries[t + 1].viseme if t + 1 < len(queries) else -1
    near = np.flatnonzero(np.isfinite(target))
    if len(near) > softness.limit:
        near = near[looks[near] <= np.partition(looks[near], softness.limit - 1)[softness.limit - 1]]
    astray = (after[near] < 0) | (nodes.visemes[after[near]] != follows)
    order = np.lexsort((nodes.numbers[near], astray, looks[near]))
    return np.union1d(near[order[: softness.limit]], own).astype(np.int64)


def step_matrix(nodes: Nodes, i: Ints, j: Ints) -> Floats:
    """[n, m] TC of all steps from nodes i to nodes j, by matrix products."""
    w, p = nodes.weights, nodes.before[j]
    cost = _squared_distances(nodes.ends(i), nodes.joints(j))
    lengths = np.where(p >= 0, nodes.lengths[p], 0)
    for length in np.unique(lengths[lengths >= 3]):
        columns = np.flatnonzero(lengths == length)
        u = np.linspace(0, 1, length)[:, None]
        fading = np.diff((1 - u) * stretched(nodes, i, int(length)), n=2, axis=1)
        rising = np.diff(u * stretched(nodes, p[columns], int(length)), n=2, axis=1)
        cost[:, columns] += w.beta * _squared_distances(fading.reshape(len(i), -1), -rising.reshape(len(columns), -1))
    cost += np.where(nodes.visemes[i][:, None] == nodes.visemes[p], 0.0, w.pnt)
    cost[:, p < 0] = w.alpha * w.pnt
    return np.where(i[:, None] == p, 0.0, cost)


def _squared_distances(a: Floats, b: Floats) -> Floats:
    squared = np.square(a).sum(axis=1)[:, None] + np.square(b).sum(axis=1) - 2 * product(a, b.T)
    return np.maximum(squared, 0.0)
