"""What the step from one node to another costs: TC (Deng 2008, eq. 4-8), of pairs and of whole blocks.

TC(i, j) is the first of these rules that applies, p being the captured predecessor of j:

1. i is p: nothing.
2. i says p's viseme: `beta·DSC(i, p) + eta·PGap(i, j) + VGap(i, j)`.
3. i says another viseme: the same + PNT.
4. j has no captured predecessor: alpha·PNT.

PGap and VGap are the squared jumps of position, and of velocity per frame, from the end of i to the start of j; the velocity
of a node of one frame is taken as zero. DSC(i, p) is the bending of the blend `w p + (1 - w) i`, where i is stretched to p's
length and w goes from 0 to 1 over it: the sum of squared second differences, 0 below three frames. (Both papers print the
integral of the second derivative itself, which would let bends cancel.)
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..efase.costs import Query, Weights, all_targets
from ..efase.nodes import Nodes
from ..products import product
from ..warp import stretched

TOGETHER = 48
"""Pairs of nodes whose bending is computed at once."""


def path_cost(nodes: Nodes, query: Query, path: Ints, weights: Weights) -> float:
    """The whole COST of one path [T]."""
    return cost_along(nodes, all_targets(nodes, query, weights), path, weights)


def cost_along(nodes: Nodes, targets: Floats, path: Ints, weights: Weights) -> float:
    """The same by target costs [T, N] that are there already."""
    return sum(targets[np.arange(len(path)), path].tolist()) + float(step_costs(nodes, path[:-1], path[1:], weights).sum())


def step_costs(nodes: Nodes, i: Ints, j: Ints, weights: Weights) -> Floats:
    """[n] TC of the pairs (i, j); what a pair costs does not depend on the pairs beside it, to the last bit."""
    w, p = weights, nodes.before[j]
    joint = np.square(end_vectors(nodes, i, w) - start_vectors(nodes, j, w)).sum(axis=1)
    cost = w.beta * _bending(nodes, i, np.maximum(p, 0)) + joint
    cost = cost + np.where(nodes.visemes[i] == nodes.visemes[p], 0.0, w.pnt)
    return np.where(p == i, 0.0, np.where(p < 0, w.alpha * w.pnt, cost))


def end_vectors(nodes: Nodes, which: Ints, weights: Weights) -> Floats:
    """[n, 2D] such that ‖end(i) - start(j)‖² is eta·PGap + VGap."""
    position, velocity = _ends(nodes, which)
    return np.hstack([np.sqrt(weights.eta) * position, velocity])


def start_vectors(nodes: Nodes, which: Ints, weights: Weights) -> Floats:
    """[n, 2D], the other side of `end_vectors`."""
    position, velocity = _starts(nodes, which)
    return np.hstack([np.sqrt(weights.eta) * position, velocity])


def _ends(nodes: Nodes, which: Ints) -> tuple[Floats, Floats]:
    """Position and velocity [n, D] at the end of nodes."""
    at = nodes.stops[which] - 1
    position = nodes.frames[at].astype(np.float64)
    return position, position - nodes.frames[at - (nodes.lengths[which] > 1)]


def _starts(nodes: Nodes, which: Ints) -> tuple[Floats, Floats]:
    at = nodes.starts[which]
    position = nodes.frames[at].astype(np.float64)
    return position, nodes.frames[at + (nodes.lengths[which] > 1)] - position


def _bending(nodes: Nodes, i: Ints, p: Ints) -> Floats:
    """[n] DSC of pairs; pairs of like length go together, so that little is computed for nothing."""
    cost = np.empty(len(i))
    order = np.argsort(nodes.lengths[p])
    for some in np.split(order, range(TOGETHER, len(i), TOGETHER)):
        cost[some] = _bending_of_some(nodes, i[some], p[some])
    return cost


def _bending_of_some(nodes: Nodes, i: Ints, p: Ints) -> Floats:
    length_i, length = nodes.lengths[i], nodes.lengths[p]
    k = np.arange(max(int(length.max(initial=0)), 3))
    span = np.maximum(length - 1, 1)[:, None]
    at = k * (length_i - 1)[:, None] / span
    low = np.minimum(at.astype(np.int64), np.maximum(length_i - 2, 0)[:, None])
    fade, last = np.where(k < length[:, None], 1 - k / span, 0.0), len(nodes.frames) - 1
    first = nodes.starts[i][:, None]
    here = nodes.frames[np.minimum(first + low, last)]
    there = nodes.frames[np.minimum(first + np.minimum(low + 1, (length_i - 1)[:, None]), last)]
    share = at - low
    blend = (fade * (1 - share))[..., None] * here + (fade * share)[..., None] * there
    blend += (k / span)[..., None] * nodes.frames[np.minimum(nodes.starts[p][:, None] + k, last)]
    bent = blend[:, :-2] - 2 * blend[:, 1:-1] + blend[:, 2:]
    inside = k[:-2] < (length - 2)[:, None]
    # Added up one after the other: what a pair costs must not depend on how long the pairs beside it are.
    return np.cumsum(np.einsum("nkd,nkd->nk", bent, bent) * inside, axis=1)[:, -1]


@dataclass(frozen=True, eq=False)
class StepTerms:
    """Of all steps from n nodes to m nodes; what rules 1 and 4 decide alone is zero in the first four.

    TC is linear in the weights. Kept apart, the terms give the cost under any weights; as tensors, its gradient in them.
    """

    bend: Any
    """[n, m] DSC, squared unit of the motion."""
    place: Any
    """[n, m] PGap."""
    speed: Any
    """[n, m] VGap."""
    switches: Any
    """[n, m] 1 where rule 3 adds PNT: another viseme class than that of the captured predecessor."""
    orphans: Any
    """[m] 1 where rule 4 applies: no captured predecessor."""
    captured: Any
    """[n, m] 1 where the step was captured (rule 1)."""

    def cost(self, pnt: Any, alpha: Any, beta: Any, eta: Any) -> Any:
        """[n, m] TC under the weights of these names, numbers or tensors."""
        return beta * self.bend + eta * self.place + self.speed + pnt * (self.switches + alpha * self.orphans)


def step_terms(nodes: Nodes, before: Ints, after: Ints) -> StepTerms:
    """Terms of the steps from the nodes `before` [n] to the nodes `after` [m], float64, by matrix products."""
    previous = nodes.before[after]
    orphan: NDArray[np.bool_] = previous < 0
    captured = before[:, None] == previous
    free = ~(captured | orphan)
    switches = free & (nodes.visemes[before][:, None] != nodes.visemes[previous][None])
    pairs = zip(_ends(nodes, before), _starts(nodes, after), strict=True)
    place, speed = (squared_distances(end, start) * free for end, start in pairs)
    bend = bends(nodes, before, previous) * free
    return StepTerms(bend, place, speed, *(np.asarray(mark, np.float64) for mark in (switches, orphan, captured)))


def step_matrix(nodes: Nodes, before: Ints, after: Ints, weights: Weights) -> Floats:
    """[n, m] TC of all steps from the nodes `before` to the nodes `after`, to the rounding of matrix products."""
    cost = step_terms(nodes, before, after).cost(weights.pnt, weights.alpha, weights.beta, weights.eta)
    return np.asarray(cost)


def bends(nodes: Nodes, before: Ints, previous: Ints) -> Floats:
    """[n, m] DSC from the nodes `before` to the nodes `previous`, of which -1 are passed over; a product for each length."""
    cost = np.zeros((len(before), len(previous)))
    lengths = np.where(previous >= 0, nodes.lengths[previous], 0)
    for length in np.unique(lengths[lengths >= 3]):
        columns = np.flatnonzero(lengths == length)
        w = np.linspace(0, 1, length)[:, None]
        fading = np.diff((1 - w) * stretched(nodes, before, int(length)), n=2, axis=1)
        rising = np.diff(w * stretched(nodes, previous[columns], int(length)), n=2, axis=1)
        cost[:, columns] = squared_distances(fading.reshape(len(before), -1), -rising.reshape(len(columns), -1))
    return cost


def squared_distances(a: Floats, b: Floats, lowered: float = 0.0) -> Floats:
    """[n, m] ‖a - b‖² of rows a [n, k] and b [m, k]; lowered by a share of ‖a‖² + ‖b‖², which makes it a bound."""
    total = np.square(a).sum(axis=1)[:, None] + np.square(b).sum(axis=1)
    return np.asarray(np.maximum(total * (1 - lowered) - 2 * product(a, b.T), 0.0))
