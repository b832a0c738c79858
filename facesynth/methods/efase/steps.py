"""The terms of the transition cost between a few nodes and a few others, by matrix products.

TC is linear in the weights: `beta·DSC + eta·PGap + VGap + pnt·(another viseme)`, or alpha·pnt without a captured
predecessor, or nothing for the captured successor. Kept apart, the terms give the cost under any weights, and its
gradient in them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from facesynth.inference.warp import stretched
from facesynth.methods.efase.nodes import Floats, Ints, MotionNodes


@dataclass(frozen=True, eq=False)
class StepTerms:
    """Of all steps from n nodes to m nodes; what rules 1 and 4 decide alone is zero in the first three."""

    bend: Tensor
    """[n, m] DSC, squared unit of the motion."""
    place: Tensor
    """[n, m] PGap."""
    speed: Tensor
    """[n, m] VGap."""
    switches: Tensor
    """[n, m] 1 where rule 3 adds PNT: another viseme class than that of the captured predecessor."""
    orphans: Tensor
    """[m] 1 where rule 4 applies: no captured predecessor."""
    captured: Tensor
    """[n, m] 1 where the step was captured (rule 1)."""

    def cost(self, weights: CostWeights) -> Tensor:
        """[n, m] TC; differentiable in the weights."""
        smooth = weights.beta * self.bend + weights.eta * self.place + self.speed
        return smooth + weights.pnt * (self.switches + weights.alpha * self.orphans)


@dataclass(frozen=True)
class CostWeights:
    """The weights that a transition depends on, as numbers or as tensors to learn; see `Weights`."""

    pnt: float | Tensor
    alpha: float | Tensor
    beta: float | Tensor
    eta: float | Tensor


def step_terms(nodes: MotionNodes, before: Ints, after: Ints) -> StepTerms:
    """Terms of the steps from the nodes `before` [n] to the nodes `after` [m], float64."""
    previous = nodes.before[after]
    orphan: NDArray[np.bool_] = previous < 0
    captured = before[:, None] == previous
    free = ~(captured | orphan)
    switches = free & (nodes.visemes[before][:, None] != nodes.visemes[previous][None])
    place, speed = _joint_terms(nodes, before, after)
    terms = (_bends(nodes, before, previous) * free, place * free, speed * free, switches, orphan, captured)
    return StepTerms(*(torch.from_numpy(np.ascontiguousarray(term, np.float64)) for term in terms))


def _joint_terms(nodes: MotionNodes, before: Ints, after: Ints) -> tuple[Floats, Floats]:
    """PGap and VGap [n, m]; the velocity of a node of one frame is taken as zero."""
    last, first = nodes.stops[before] - 1, nodes.starts[after]
    inner_last = last - (nodes.lengths[before] > 1)
    inner_first = first + (nodes.lengths[after] > 1)
    frames = nodes.frames
    leave, arrive = frames[last] - frames[inner_last], frames[inner_first] - frames[first]
    return _squared_distances(frames[last], frames[first]), _squared_distances(leave, arrive)


def _bends(nodes: MotionNodes, before: Ints, previous: Ints) -> NDArray[np.float64]:
    """DSC(i, pre(j)) [n, m], one matrix product for each length of pre(j); 0 below three frames."""
    cost = np.zeros((len(before), len(previous)))
    lengths = np.where(previous >= 0, nodes.lengths[previous], 0)
    for length in np.unique(lengths[lengths >= 3]):
        columns = np.flatnonzero(lengths == length)
        w = np.linspace(0, 1, length)[:, None]
        fading = np.diff((1 - w) * stretched(nodes, before, int(length)), n=2, axis=1)
        rising = np.diff(w * stretched(nodes, previous[columns], int(length)), n=2, axis=1)
        cost[:, columns] = _squared_distances(fading.reshape(len(before), -1), -rising.reshape(len(columns), -1))
    return cost


def _squared_distances(a: Floats, b: Floats) -> Floats:
    """[n, m] ‖a - b‖²."""
    squared = (a * a).sum(axis=1)[:, None] + (b * b).sum(axis=1) - 2 * a @ b.T
    return np.asarray(np.maximum(squared, 0.0))
