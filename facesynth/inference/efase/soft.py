"""Every path counts, the cheaper the more: the search with its minimum replaced by a soft one.

`posterior` has the recursion. It runs over a few candidates of each phone, chosen by `candidates`; over as many as the
database has nodes it is exact.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..arrays import Floats, Ints
from ..efase.costs import Query, Weights
from ..efase.nodes import Nodes
from ..efase.steps import step_matrix
from ..posterior import posterior
from ..warp import stretched


@dataclass(frozen=True, eq=False)
class Mixture:
    """The nodes that may stand at one phone, with their posterior probabilities."""

    nodes: Ints
    """[n]"""
    shares: Floats
    """[n] sum to 1."""
    captured: float
    """Probability that the step into this phone was captured; 0 at the first phone."""


StepMatrix = Callable[[Nodes, Ints, Ints, Weights], Floats]
"""What `step_matrix` does, or remembers of it."""
Mix = Callable[[Sequence[Ints], Sequence[Floats], float], list[Mixture]]
"""Mixtures of candidates [n_t] at T phones, by their target costs [n_t] and a temperature."""


def soft_search(
    nodes: Nodes,
    query: Query,
    targets: Floats,
    weights: Weights,
    path: Ints,
    temperature: float,
    limit: int,
    matrix: StepMatrix = step_matrix,
    mix: Mix | None = None,
) -> list[Mixture]:
    """A mixture of nodes for each phone. targets [T, N]; `path` [T], the cheapest one, is always among the candidates.

    The means over paths are taken by `mix`, where it is given, or by numpy over the costs that `matrix` gives.
    """
    chosen = candidates(nodes, query, targets, weights, path, limit)
    costs = [target[which] for target, which in zip(targets, chosen, strict=True)]
    if mix is not None:
        return mix(chosen, costs, temperature)
    scores = [-cost / temperature for cost in costs]
    moves = [-matrix(nodes, i, j, weights) / temperature for i, j in pairwise(chosen)]
    found, captured = posterior(scores, moves), [0.0]
    for t, (here, there) in enumerate(pairwise(chosen)):
        column = np.flatnonzero(np.isin(nodes.before[there], here))
        row = np.searchsorted(here, nodes.before[there[column]])
        captured.append(float(found.of_steps(t, row, column).sum()))
    return [Mixture(*parts) for parts in zip(chosen, found.shares(), captured, strict=True)]


def mean_motion(nodes: Nodes, mixture: Mixture, count: int) -> Floats:
    """[count, D] posterior mean of the nodes of a mixture, each time-warped to `count` frames."""
    return np.asarray(np.tensordot(mixture.shares, stretched(nodes, mixture.nodes, count), 1))


def candidates(nodes: Nodes, query: Query, targets: Floats, weights: Weights, path: Ints, limit: int) -> list[Ints]:
    """For each phone the `limit` nodes that look cheapest before any transition is known, and the one of `path`.

    What a node looks like to cost: its target cost, alpha·PNT where it has no captured predecessor, PNT where that one
    says another viseme than the phone before. Ties go to nodes whose captured successor says the viseme that follows,
    then to the lowest. Nodes of infinite target cost (hard constraints, shut lips) are never among them.
    """
    following: Sequence[int] = [*query.visemes[1:].tolist(), -1]
    chosen = []
    for t, (target, follows) in enumerate(zip(targets, following, strict=True)):
        looks = target if t == 0 else target + _entering(nodes, int(query.visemes[t - 1]), weights)
        near = np.flatnonzero(np.isfinite(target))
        if len(near) > limit:  # the rest need not be sorted
            near = near[looks[near] <= np.partition(looks[near], limit - 1)[limit - 1]]
        astray = (nodes.after[near] < 0) | (nodes.visemes[nodes.after[near]] != follows)
        order = np.lexsort((astray, looks[near]))
        chosen.append(np.union1d(near[order[:limit]], path[t]).astype(np.int64))
    return chosen


def _entering(nodes: Nodes, viseme: int, weights: Weights) -> Floats:
    other = nodes.visemes[nodes.before] != viseme if viseme >= 0 else np.zeros(len(nodes), bool)
    return np.where(nodes.before < 0, weights.alpha, np.where(other, 1.0, 0.0)) * weights.pnt
