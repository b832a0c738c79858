"""The cost of a path of motion nodes (Deng 2008, eq. 3-12), literally and as vectors.

`COST = sum_t TC(o_t, o_t+1) + sum_t [OC(P_t, o_t) + EMP(E_t, o_t) + B(t, o_t)]`
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.warp import time_warp
from facesynth.methods.efase.nodes import Floats, Ints, MotionNodes


@dataclass(frozen=True)
class Weights:
    """Parameters of the cost; the defaults are the published ones (Deng 2006, §5.3)."""

    pnt: float
    """The large constant PNT, which the papers do not give; in squared units of the motion."""
    alpha: float = 3.6052
    """a1: a step to a node that has no captured predecessor."""
    beta: float = 5.7814
    """a2: distance of shapes over a whole phone, DSC."""
    eta: float = 6.8282
    """a3: jump of position at the joint, PGap."""
    gamma: float = 0.2903
    """a4: another phone of the same viseme class."""
    delta: float = 0.315
    """a5: another phone."""
    phi: float = 0.109
    """a6: another emotion."""


@dataclass(frozen=True, eq=False)
class Query:
    """What is to be said: T phones."""

    phones: Ints
    """[T] index of the wanted phone, -1 for `pau`."""
    visemes: Ints
    """[T] its viseme class, -1 for `pau`."""
    emotions: Ints
    """[T] index of the wanted emotion, -1 for any."""
    fixed: Mapping[int, int]
    """Hard constraints: position in the input -> node."""
    strict: NDArray[np.bool_] | None = None
    """[T] where no node of another viseme class is allowed; nowhere if it is None."""
    heard: Floats | None = None
    """[T, N] audio cost of every node at every phone, not negative; none if it is None."""

    def __len__(self) -> int:
        return len(self.phones)


def target_costs(nodes: MotionNodes, query: Query, t: int, weights: Weights) -> Floats:
    """[N] OC + EMP + B, and the audio cost, of every node at position t; infinite where a hard constraint forbids the node."""
    cost = np.zeros(len(nodes))
    if query.phones[t] >= 0:
        other = nodes.phones != query.phones[t]
        same_viseme = nodes.visemes == query.visemes[t]
        cost += np.where(other, np.where(same_viseme, weights.gamma, 1.0) * weights.delta * weights.pnt, 0.0)
    if query.emotions[t] >= 0:
        cost += np.where(nodes.emotions != query.emotions[t], weights.phi * weights.pnt, 0.0)
    if query.heard is not None:
        cost += query.heard[t]
    if query.strict is not None and query.strict[t]:
        cost[nodes.visemes != query.visemes[t]] = np.inf
    if t in query.fixed:
        cost[np.arange(len(nodes)) != query.fixed[t]] = np.inf
    return cost


def end_vectors(nodes: MotionNodes, weights: Weights) -> Floats:
    """[N, 2D] such that ‖end(i) - start(j)‖² is PVC(i, j) = eta·PGap + VGap."""
    return _joint_vectors(nodes, nodes.stops - 1, nodes.stops - 2, 1.0, weights)


def start_vectors(nodes: MotionNodes, weights: Weights) -> Floats:
    """[N, 2D], the other side of `end_vectors`."""
    return _joint_vectors(nodes, nodes.starts, nodes.starts + 1, -1.0, weights)


def _joint_vectors(nodes: MotionNodes, at: Ints, inner: Ints, sign: float, weights: Weights) -> Floats:
    # The velocity of a node of one frame is unknown and taken as zero.
    inner = np.where(nodes.lengths > 1, inner, at)
    position = nodes.frames[at]
    velocity = sign * (position - nodes.frames[inner])
    return np.hstack([np.sqrt(weights.eta) * position, velocity])


def joint_cost(nodes: MotionNodes, i: int, j: int, weights: Weights) -> float:
    """PVC(i, j): squared jump of position, and of velocity per frame, from the end of i to the start of j."""
    last, first = nodes.motion(i), nodes.motion(j)
    leave = last[-1] - last[-2] if len(last) > 1 else 0 * last[-1]
    arrive = first[1] - first[0] if len(first) > 1 else 0 * first[0]
    return float(weights.eta * ((first[0] - last[-1]) ** 2).sum() + ((arrive - leave) ** 2).sum())


def shape_cost(nodes: MotionNodes, i: int, p: int) -> float:
    """DSC(i, p): bending of the blend of i, stretched to p's length, into p; 0 below 3 frames.

    The blend is `w p + (1 - w) i`, w from 0 to 1 over p's frames, its bending the sum of squared
    second differences. (Both papers print the integral of the second derivative itself, which
    would let bends cancel.)
    """
    target = nodes.motion(p)
    if len(target) < 3:
        return 0.0
    w = np.linspace(0, 1, len(target))[:, None]
    blend = w * target + (1 - w) * time_warp(nodes.motion(i), len(target))
    return float((np.diff(blend, n=2, axis=0) ** 2).sum())


def transition_cost(nodes: MotionNodes, i: int, j: int, weights: Weights) -> float:
    """TC(i, j), first rule that applies (Deng 2008, eq. 4)."""
    p = int(nodes.before[j])
    if p == i:
        return 0.0
    if p < 0:
        return weights.alpha * weights.pnt
    cost = weights.beta * shape_cost(nodes, i, p) + joint_cost(nodes, i, j, weights)
    return cost if nodes.visemes[i] == nodes.visemes[p] else cost + weights.pnt


def path_cost(nodes: MotionNodes, query: Query, path: Ints, weights: Weights) -> float:
    """The whole COST of one path [T]."""
    targets = sum(target_costs(nodes, query, t, weights)[node] for t, node in enumerate(path))
    steps = sum(transition_cost(nodes, int(i), int(j), weights) for i, j in pairwise(path))
    return float(targets + steps)
