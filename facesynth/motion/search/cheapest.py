"""The cheapest path: min-plus over blocks of steps (Deng 2008, Algorithm 1; Cao 2005, eq. 2).

    phi_1(j) = target_1(j),    phi_t(j) = min_i [phi_t-1(i) + step(i, j)] + target_t(j)

phi is float64. Where steps have a lower bound, in float32, only the pairs are computed whose bound may be the least of
their row: the best ones first, then all that are not beyond what these cost. So the path is that of the recursion in
float64 throughout; ties go to the first candidate.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from facesynth.motion.search.steps import ALL, LOWERED, BoundedSteps, Steps, block_size, lengths_of, split_places

TRIED = (1, 4)
"""Pairs of each next candidate that are computed first, by rising bound; each time the best one so far rules out more."""
RAISED = 1 + 2.0**-20
"""Of upper bounds, which are compared with sums in float32."""
LARGEST = 1e30
"""Cost of no path."""


@dataclass(frozen=True, eq=False)
class Cheapest:
    """The best path of each of B utterances."""

    path: Tensor
    """[B, T] which candidate stands at each position, -1 after an utterance's end."""
    cost: Tensor
    """[B] float64."""


@torch.no_grad()
def cheapest(
    targets: Sequence[Tensor], steps: Steps, lengths: Tensor | None = None, limits: Sequence[Tensor] | None = None
) -> Cheapest:
    """The path of least cost through T positions.

    targets: T of [B, n_t], infinite where a candidate is forbidden or missing. lengths: [B] positions of each utterance,
    all T unless given. limits: T of [B, n_t] what a best path costs at most up to each candidate, where that is known.
    Raises FacesynthError where a position has no candidate of finite cost.
    """
    lengths = lengths_of(targets, lengths)
    phi, origins = targets[0].double(), []
    cost, last = phi.min(dim=1)
    for t, target in enumerate(targets[1:]):
        if isinstance(steps, BoundedSteps):
            limit = torch.full_like(phi[:, :1], LARGEST) if limits is None else limits[t + 1]
            reached, origin = _bounded(t, phi, limit - target, steps)
        else:
            reached, origin = _compared(t, phi, target.shape[1], steps)
        phi = reached + target
        origins.append(origin.int())
        least, at = phi.min(dim=1)
        ends = lengths == t + 2
        cost, last = torch.where(ends, least, cost), torch.where(ends, at, last)
    return Cheapest(_traced(origins, last, lengths), cost)


def _traced(origins: Sequence[Tensor], last: Tensor, lengths: Tensor) -> Tensor:
    node, path = torch.where(lengths == len(origins) + 1, last, 0), []
    for t in range(len(origins), -1, -1):
        path.append(torch.where(t < lengths, node, -1))
        if t:
            node = origins[t - 1].gather(1, node[:, None])[:, 0].long()
            node = torch.where(lengths == t, last, node)
    return torch.stack(path[::-1], dim=1)


def _compared(t: int, phi: Tensor, count: int, steps: Steps) -> tuple[Tensor, Tensor]:
    """[B, m] least phi_t(i) + step(i, j), and the first such i, straight."""
    reached = phi.new_empty(len(phi), count)
    origin = torch.empty_like(reached, dtype=torch.int64)
    for rows in steps.rows(t, block_size(phi.device) // len(phi)):
        reached[:, rows], origin[:, rows] = (steps.cost(t, rows, ALL) + phi[:, None]).min(dim=2)
    return reached, origin


def _bounded(t: int, phi: Tensor, limit: Tensor, steps: BoundedSteps) -> tuple[Tensor, Tensor]:
    """The same by few pairs; what is beyond the limit [B, m] may stay infinite."""
    columns, size = phi.isfinite().any(dim=0).nonzero()[:, 0], block_size(phi.device)
    least = phi.amin(dim=1, keepdim=True).nan_to_num(posinf=0.0)
    above, limit = (phi - least)[:, columns].float(), limit - least
    reached, origin = torch.full_like(limit, torch.inf), torch.zeros_like(limit, dtype=torch.int64)
    for rows in steps.rows(t, size):
        lower = steps.lower(t, rows, columns)
        for some in split_places(len(phi), size // max(1, lower[0].numel()), phi.device):

            def exact(utterance: Tensor, row: Tensor, column: Tensor, some: Tensor = some, rows: Tensor = rows) -> Tensor:
                which, before = some[utterance], columns[column]
                return (phi - least)[which, before] + steps.pairs(t, which, rows[row], before)

            bounds = LOWERED * (lower if len(lower) == 1 else lower[some]) + above[some, None]
            best, place = _least(bounds, limit[some][:, rows], exact)
            reached[some[:, None], rows] = best + least[some]
            origin[some[:, None], rows] = columns[place] if len(columns) else place
    return reached, origin


def _least(bounds: Tensor, limit: Tensor, exact: Callable[[Tensor, Tensor, Tensor], Tensor]) -> tuple[Tensor, Tensor]:
    """[b, r] the least cost of each row and its first column; infinite where bounds [b, r, c] are beyond the limit [b, r]."""
    best, place = torch.full_like(limit, torch.inf), torch.full_like(limit, bounds.shape[2], dtype=torch.int64)
    for tried in (*TRIED, bounds.shape[2]):
        within = (torch.minimum(best, limit) * RAISED).clamp(max=LARGEST).float()[..., None]
        if tried < bounds.shape[2]:
            lowest, column = bounds.topk(tried, dim=2, largest=False)
            utterance, row, rank = (lowest <= within).nonzero(as_tuple=True)
            column = column[utterance, row, rank]
        else:
            utterance, row, column = (bounds <= within).nonzero(as_tuple=True)
        bounds[utterance, row, column] = torch.inf
        costs, flat = exact(utterance, row, column), utterance * limit.shape[1] + row
        least = best.flatten().scatter_reduce(0, flat, costs, "amin")
        tied = costs == least[flat]
        first = torch.where(best.flatten() == least, place.flatten(), bounds.shape[2])
        place = first.scatter_reduce(0, flat[tied], column[tied], "amin").view_as(best)
        best = least.view_as(best)
    return best, torch.where(best.isfinite(), place, 0)
