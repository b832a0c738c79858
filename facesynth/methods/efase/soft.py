"""Every path counts, the cheaper the more: the search with its minimum replaced by a soft one.

At temperature tau a path o of the cost C(o) has the probability exp(-C(o) / tau) / Z. The recursion is that of the
search with `-tau log sum exp(-· / tau)` in the place of `min`:

    alpha_1(j) = -target_1(j) / tau,   alpha_t(j) = log sum_i exp[alpha_t-1(i) - TC(i, j) / tau] - target_t(j) / tau
    beta_T(i) = 0,                     beta_t(i) = log sum_j exp[-(TC(i, j) + target_t+1(j)) / tau + beta_t+1(j)]

and alpha + beta - log Z is the logarithm of each node's posterior at each phone. tau -> 0 is the paper's minimum. All
of it is differentiable in the costs. It runs over a few candidates of each phone, chosen by `candidates`; over as many
as the database has nodes it is exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import torch
from torch import Tensor

from facesynth.methods.efase.costs import Query, Weights
from facesynth.methods.efase.nodes import Floats, Ints, MotionNodes
from facesynth.methods.efase.steps import CostWeights, step_terms, stretched


@dataclass(frozen=True, eq=False)
class Mixture:
    """The nodes that may stand at one phone, with their posterior probabilities."""

    nodes: Ints
    """[n]"""
    shares: Floats
    """[n] sum to 1."""
    captured: float
    """Probability that the step into this phone was captured; 0 at the first phone."""


@dataclass(frozen=True, eq=False)
class Posterior:
    """What the recursion finds over T phones with n_t candidates each."""

    nodes: list[Tensor]
    """T of [n_t] probabilities."""
    steps: list[Tensor]
    """T - 1 of [n_t, n_t+1] probabilities of pairs."""
    log_z: Tensor
    """Logarithm of the sum of exp(-C / tau) over all paths."""


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


def posterior(targets: Sequence[Tensor], steps: Sequence[Tensor], temperature: float | Tensor) -> Posterior:
    """Forward and backward; targets T of [n_t], steps T - 1 of [n_t, n_t+1], all finite."""
    scores, moves = [-target / temperature for target in targets], [-step / temperature for step in steps]
    forward, backward = [scores[0]], [torch.zeros_like(scores[-1])]
    for move, score in zip(moves, scores[1:], strict=True):
        forward.append(torch.logsumexp(forward[-1][:, None] + move, dim=0) + score)
    for move, score in zip(reversed(moves), reversed(scores[1:]), strict=True):
        backward.append(torch.logsumexp(move + (score + backward[-1])[None], dim=1))
    backward.reverse()
    log_z = torch.logsumexp(forward[-1], dim=0)
    singles = [torch.softmax(a + b, dim=0) for a, b in zip(forward, backward, strict=True)]
    pairs = [
        torch.exp(forward[t][:, None] + move + (scores[t + 1] + backward[t + 1])[None] - log_z) for t, move in enumerate(moves)
    ]
    return Posterior(singles, pairs, log_z)


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
