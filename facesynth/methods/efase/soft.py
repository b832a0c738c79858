"""Every path counts, the cheaper the more: the search with its minimum replaced by a soft one.

`learn.posterior` has the recursion. It runs over a few candidates of each phone, chosen by `candidates`; over as many as
the database has nodes it is exact.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import torch

from facesynth.inference.warp import stretched
from facesynth.methods.efase.costs import Query, Weights
from facesynth.methods.efase.nodes import Floats, Ints, MotionNodes
from facesynth.methods.efase.steps import CostWeights, step_terms
from facesynth.methods.learn.posterior import posterior


@dataclass(frozen=True, eq=False)
class Mixture:
    """The nodes that may stand at one phone, with their posterior probabilities."""

    nodes: Ints
    """[n]"""
    shares: Floats
    """[n] sum to 1."""
    captured: float
    """Probability that the step into this phone was captured; 0 at the first phone."""


def soft_search(
    nodes: MotionNodes, query: Query, targets: Floats, weights: Weights, path: Ints, temperature: float, limit: int
) -> list[Mixture]:
    """A mixture of nodes for each phone. targets [T, N]; `path` [T], the cheapest one, is always among the candidates."""
    chosen = candidates(nodes, query, targets, weights, path, limit)
    costs = CostWeights(weights.pnt, weights.alpha, weights.beta, weights.eta)
    terms = [step_terms(nodes, i, j) for i, j in pairwise(chosen)]
    found = posterior(
        [torch.from_numpy(targets[t, nodes_t]) for t, nodes_t in enumerate(chosen)],
        [term.cost(costs) for term in terms],
        temperature,
    )
    captured = [0.0, *(float((p * term.captured).sum()) for p, term in zip(found.steps, terms, strict=True))]
    return [Mixture(n, p.numpy(), c) for n, p, c in zip(chosen, found.nodes, captured, strict=True)]


def mean_motion(nodes: MotionNodes, mixture: Mixture, count: int) -> Floats:
    """[count, D] posterior mean of the nodes of a mixture, each time-warped to `count` frames."""
    return np.asarray(np.tensordot(mixture.shares, stretched(nodes, mixture.nodes, count), 1))


def candidates(nodes: MotionNodes, query: Query, targets: Floats, weights: Weights, path: Ints, limit: int) -> list[Ints]:
    """For each phone the `limit` nodes that look cheapest before any transition is known, and the one of `path`.

    What a node looks like to cost: its target cost, alpha·PNT where it has no captured predecessor, PNT where that one
    says another viseme than the phone before. Ties go to nodes whose captured successor says the viseme that follows,
    then to the lowest. Nodes of infinite target cost (hard constraints, shut lips) are never among them.
    """
    chosen = []
    for t, target in enumerate(targets):
        entering = np.zeros(len(nodes)) if t == 0 else _entering(nodes, int(query.visemes[t - 1]), weights)
        follows = query.visemes[t + 1] if t + 1 < len(query) else -1
        astray = (nodes.after < 0) | (nodes.visemes[nodes.after] != follows)
        order = np.lexsort((astray, target + entering))
        order = order[np.isfinite(target[order])][:limit]
        chosen.append(np.union1d(order, path[t]).astype(np.int64))
    return chosen


def _entering(nodes: MotionNodes, viseme: int, weights: Weights) -> Floats:
    other = nodes.visemes[nodes.before] != viseme if viseme >= 0 else np.zeros(len(nodes), bool)
    return np.where(nodes.before < 0, weights.alpha, np.where(other, 1.0, 0.0)) * weights.pnt
