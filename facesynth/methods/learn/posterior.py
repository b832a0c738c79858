"""How probable each state of a chain is, where every path counts, the cheaper the more; differentiable in the costs.

At temperature tau a path o of the cost C(o) has the probability exp(-C(o) / tau) / Z. The recursion is that of the
cheapest path with `-tau log sum exp(-· / tau)` in the place of `min`:

    alpha_1(j) = -target_1(j) / tau,   alpha_t(j) = log sum_i exp[alpha_t-1(i) - step(i, j) / tau] - target_t(j) / tau
    beta_T(i) = 0,                     beta_t(i) = log sum_j exp[-(step(i, j) + target_t+1(j)) / tau + beta_t+1(j)]

and alpha + beta - log Z is the logarithm of each state's posterior. tau -> 0 is the cheapest path.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor


@dataclass(frozen=True, eq=False)
class Posterior:
    """What the recursion finds over T phones with n_t candidates each."""

    nodes: list[Tensor]
    """T of [n_t] probabilities."""
    steps: list[Tensor]
    """T - 1 of [n_t, n_t+1] probabilities of pairs."""
    log_z: Tensor
    """Logarithm of the sum of exp(-C / tau) over all paths."""


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
