"""The database and its cost (Deng 2008, eq. 3-12)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]

COLUMNS = ("starts", "stops", "phones", "visemes", "emotions", "before", "numbers")
TOGETHER = 48
"""Pairs of nodes whose bending is computed at once."""


@dataclass(frozen=True)
class Weights:
    """Parameters of the cost, PNT in the units of the database."""

    pnt: float
    alpha: float
    beta: float
    eta: float
    gamma: float
    delta: float
    phi: float


@dataclass(frozen=True, eq=False)
class Query:
    """What is to be said: one phone."""

    phone: int
    viseme: int
    emotion: int
    node: int = -1
    """The node that must be used, or -1."""
    strict: bool = False
    """Whether no node of another viseme class is allowed."""
    heard: Floats | None = None
    """[N] what every node costs beside that, for how it sounds and moves; None where nothing is heard."""


@dataclass(frozen=True, eq=False)
class Nodes:
    """N nodes over frames of D coordinates, sorted by viseme class, phone and emotion."""

    frames: NDArray[np.float32]
    starts: Ints
    stops: Ints
    phones: Ints
    visemes: Ints
    emotions: Ints
    before: Ints
    numbers: Ints
    """[N] place in the database as it was trained: of two that cost the same, the lower one is taken."""
    weights: Weights

    @classmethod
    def of(cls, arrays: Mapping[str, NDArray[Any]], weights: Weights) -> Nodes:
        """From a folder's arrays; frames in 8 bits have a scale beside them."""
        frames = arrays["node_frames"].astype(np.float32, copy=False)
        if "node_frames_scale" in arrays:
            frames = frames * arrays["node_frames_scale"]
        columns = {name: arrays[name].astype(np.int64) for name in COLUMNS}
        return cls(frames, **columns, weights=weights)

    def __len__(self) -> int:
        return len(self.starts)

    @cached_property
    def lengths(self) -> Ints:
        """[N] frames of each node."""
        return self.stops - self.starts

    @cached_property
    def class_starts(self) -> Ints:
        """[C] first node of each class: one phone in one emotion."""
        change = (np.diff(self.phones) != 0) | (np.diff(self.emotions) != 0)
        return np.concatenate([[0], np.flatnonzero(change) + 1]).astype(np.int64)

    @cached_property
    def class_of(self) -> Ints:
        """[N] class of each node."""
        return np.repeat(np.arange(len(self.class_starts)), np.diff(np.append(self.class_starts, len(self))))

    def motion(self, node: int) -> Floats:
        """[L, D] frames of one node."""
        return self.frames[self.starts[node] : self.stops[node]].astype(np.float64)

    def class_targets(self, query: Query) -> Floats:
        """[C] cost of the nodes of every class as an answer to one phone; infinite where they are forbidden."""
        w, first = self.weights, self.class_starts
        same = self.visemes[first] == query.viseme
        cost = np.zeros(len(first))
        if query.phone >= 0:
            cost += np.where(self.phones[first] != query.phone, np.where(same, w.gamma, 1.0) * w.delta * w.pnt, 0.0)
        if query.emotion >= 0:
            cost += np.where(self.emotions[first] != query.emotion, w.phi * w.pnt, 0.0)
        if query.strict:
            cost[~same] = np.inf
        return cost

    def cost(self, queries: Sequence[Query], path: Ints) -> float:
        """The whole COST of a path [T]."""
        own, total = self.class_of[path], float(self.steps(path[:-1], path[1:]).sum())
        for query, node, number in zip(queries, path.tolist(), own.tolist(), strict=True):
            total += float(self.class_targets(query)[number]) + (0.0 if query.heard is None else float(query.heard[node]))
        return total

    def steps(self, i: Ints, j: Ints) -> Floats:
        """[n] transition costs TC(i, j) of pairs of nodes."""
        w, p = self.weights, self.before[j]
        cost = w.beta * self.bending(i, np.maximum(p, 0)) + np.square(self.ends(i) - self.joints(j)).sum(axis=1)
        cost = cost + np.where(self.visemes[i] == self.visemes[p], 0.0, w.pnt)
        return np.where(p == i, 0.0, np.where(p < 0, w.alpha * w.pnt, cost))

    def ends(self, which: Ints) -> Floats:
        """[n, 2D] such that ‖end(i) - joint(j)‖² = eta PGap + VGap, the cost of a joint."""
        return self._joint_vectors(which, self.stops[which] - 1, -1, 1.0)

    def joints(self, which: Ints) -> Floats:
        """[n, 2D]"""
        return self._joint_vectors(which, self.starts[which], 1, -1.0)

    def bending(self, i: Ints, p: Ints) -> Floats:
        """[n] DSC(i, p): i stretched to p's length and faded out, its second difference added to that of p fading in.

        Pairs of like length go together, so that little is computed for nothing.
        """
        cost = np.empty(len(i))
        order = np.argsort(self.lengths[p])
        for some in np.split(order, range(TOGETHER, len(i), TOGETHER)):
            cost[some] = self._bending(i[some], p[some])
        return cost

    def _bending(self, i: Ints, p: Ints) -> Floats:
        length_i, length = self.lengths[i], self.lengths[p]
        k = np.arange(max(int(length.max(initial=0)), 3))
        span = np.maximum(length - 1, 1)[:, None]
        at = k * (length_i - 1)[:, None] / span
        low = np.minimum(at.astype(np.int64), np.maximum(length_i - 2, 0)[:, None])
        fade, last = np.where(k < length[:, None], 1 - k / span, 0.0), len(self.frames) - 1
        first = self.starts[i][:, None]
        here = self.frames[np.minimum(first + low, last)]
        there = self.frames[np.minimum(first + np.minimum(low + 1, (length_i - 1)[:, None]), last)]
        share = at - low
        blend = (fade * (1 - share))[..., None] * here + (fade * share)[..., None] * there
        blend += (k / span)[..., None] * self.frames[np.minimum(self.starts[p][:, None] + k, last)]
        bent = blend[:, :-2] - 2 * blend[:, 1:-1] + blend[:, 2:]
        inside = k[:-2] < (length - 2)[:, None]
        # Added up one after the other: what a pair costs must not depend on how long the pairs beside it are.
        return np.cumsum(np.einsum("nkd,nkd->nk", bent, bent) * inside, axis=1)[:, -1]

    def _joint_vectors(self, which: Ints, at: Ints, inward: int, sign: float) -> Floats:
        position = self.frames[at].astype(np.float64)
        inner = self.frames[np.where(self.lengths[which] > 1, at + inward, at)]
        return np.hstack([np.sqrt(self.weights.eta) * position, sign * (position - inner)])
