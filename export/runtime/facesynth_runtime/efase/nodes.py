"""The database and its cost (Deng 2008, eq. 3-12)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]


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


@dataclass(frozen=True, eq=False)
class Nodes:
    """N nodes over frames of D coordinates."""

    frames: Floats
    starts: Ints
    stops: Ints
    phones: Ints
    visemes: Ints
    emotions: Ints
    before: Ints
    nearest: Floats
    """[N] least cost of a step to the node from the viseme class of its predecessor, other than from that itself."""
    weights: Weights

    @classmethod
    def of(cls, arrays: Mapping[str, NDArray[Any]], weights: Weights) -> Nodes:
        """From a folder's arrays; frames in 8 bits have a scale beside them."""
        frames = arrays["node_frames"].astype(np.float64)
        if "node_frames_scale" in arrays:
            frames = frames * arrays["node_frames_scale"].astype(np.float64)
        columns = {name: arrays[name].astype(np.int64) for name in ("starts", "stops", "phones", "visemes", "emotions", "before")}
        return cls(frames, **columns, nearest=arrays["nearest"].astype(np.float64), weights=weights)

    def __len__(self) -> int:
        return len(self.starts)

    @cached_property
    def lengths(self) -> Ints:
        """[N] frames of each node."""
        return self.stops - self.starts

    @cached_property
    def ends(self) -> Floats:
        """[N, 2D] such that ‖end(i) - joint(j)‖² = eta PGap + VGap, the cost of a joint."""
        return self._joint_vectors(self.stops - 1, self.stops - 2, 1.0)

    @cached_property
    def joints(self) -> Floats:
        """[N, 2D]"""
        return self._joint_vectors(self.starts, self.starts + 1, -1.0)

    @cached_property
    def squares(self) -> tuple[Floats, Floats]:
        """[N] squared lengths of `ends` and of `joints`."""
        return np.square(self.ends).sum(axis=1), np.square(self.joints).sum(axis=1)

    @cached_property
    def bends(self) -> Floats:
        """[F, D] second difference of w p at each node's frames; meaningless at its last two."""
        place = np.arange(len(self.frames)) - np.repeat(self.starts, self.lengths)
        rising = (place / np.maximum(np.repeat(self.lengths, self.lengths) - 1, 1))[:, None] * self.frames
        bent = np.zeros_like(rising)
        bent[:-2] = rising[:-2] - 2 * rising[1:-1] + rising[2:]
        return bent

    def motion(self, node: int) -> Floats:
        """[L, D] frames of one node."""
        return self.frames[self.starts[node] : self.stops[node]]

    def targets(self, query: Query) -> Floats:
        """[N] cost of every node as an answer to one phone; infinite where it is forbidden."""
        w = self.weights
        same = self.visemes == query.viseme
        cost = np.zeros(len(self))
        if query.phone >= 0:
            cost += np.where(self.phones != query.phone, np.where(same, w.gamma, 1.0) * w.delta * w.pnt, 0.0)
        if query.emotion >= 0:
            cost += np.where(self.emotions != query.emotion, w.phi * w.pnt, 0.0)
        if query.strict:
            cost[~same] = np.inf
        if query.node >= 0:
            cost[np.arange(len(self)) != query.node] = np.inf
        return cost

    def steps(self, i: Ints, j: Ints) -> Floats:
        """[n] transition costs TC(i, j) of pairs of nodes."""
        w, p = self.weights, self.before[j]
        cost = w.beta * self.bending(i, np.maximum(p, 0)) + np.square(self.ends[i] - self.joints[j]).sum(axis=1)
        cost = cost + np.where(self.visemes[i] == self.visemes[p], 0.0, w.pnt)
        return np.where(p == i, 0.0, np.where(p < 0, w.alpha * w.pnt, cost))

    def bending(self, i: Ints, p: Ints) -> Floats:
        """[n] DSC(i, p): i stretched to p's length and faded out, its second difference added to that of p fading in."""
        length_i, length = self.lengths[i], self.lengths[p]
        k = np.arange(int(length.max(initial=3)))
        span = np.maximum(length - 1, 1)[:, None]
        at = k * (length_i - 1)[:, None] / span
        low = np.minimum(at.astype(np.int64), np.maximum(length_i - 2, 0)[:, None])
        share = (at - low)[..., None]
        first = self.starts[i][:, None]
        here = self.frames[np.minimum(first + low, len(self.frames) - 1)]
        there = self.frames[np.minimum(first + np.minimum(low + 1, (length_i - 1)[:, None]), len(self.frames) - 1)]
        fade = np.where(k < length[:, None], 1 - k / span, 0.0)[..., None] * (here + share * (there - here))
        rows = np.minimum(self.starts[p][:, None] + k[:-2], len(self.frames) - 1)
        bent = fade[:, :-2] - 2 * fade[:, 1:-1] + fade[:, 2:] + self.bends[rows]
        inside = k[:-2] < (length - 2)[:, None]
        return np.where(inside, np.square(bent).sum(axis=2), 0.0).sum(axis=1)

    def _joint_vectors(self, at: Ints, inner: Ints, sign: float) -> Floats:
        inner = np.where(self.lengths > 1, inner, at)
        velocity = sign * (self.frames[at] - self.frames[inner])
        return np.hstack([np.sqrt(self.weights.eta) * self.frames[at], velocity])
