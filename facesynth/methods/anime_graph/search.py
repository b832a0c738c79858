"""The path through the graph: globally optimal, or with a look-ahead of some phones (Cao 2005, §4.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numba import njit
from numpy.typing import NDArray

from facesynth.inference.errors import FacesynthError


@dataclass(frozen=True)
class Weights:
    """Of eq. 2: jumps, their cost (RMS mm) and the audio cost; beyond the paper, of the expected pose."""

    jump: float = 100.0
    jump_cost: float = 1.0
    audio: float = 0.01
    pose: float = 0.0

    def target(self, step: Step) -> NDArray[np.float64]:
        """[n] what each candidate of a step costs, wherever one comes from."""
        cost = self.audio * step.audio
        return cost if step.pose is None else cost + self.pose * step.pose


@dataclass(frozen=True, eq=False)
class Step:
    """The n candidates for one phone of the input."""

    audio: NDArray[np.float64]
    """[n] audio cost of each (eq. 5)."""
    first: NDArray[np.float64]
    """[n, D] first frame of each, in coordinates whose Euclidean distance is the RMS distance of frames."""
    last: NDArray[np.float64]
    """[n, D] last frame of each."""
    link: NDArray[np.int64]
    """[n] the candidate of the phone before that was recorded just before this one, or -1."""
    pose: NDArray[np.float64] | None = None
    """[n] mean squared distance of each from the pose that the sound leads one to expect; None where nothing predicts it."""


@njit(cache=True, fastmath={"reassoc", "contract"})
def _advance(phi, last, first, link, price):  # type: ignore[no-untyped-def]
    """One step of Viterbi: for each candidate j the least phi_i + (cost of the step i to j), and that i.

    Candidates i come by rising phi. A jump costs at least its fixed part, so that the first i with
    phi_i + jump not below the best found ends the scan: nothing after it can win. The captured
    predecessor is free and is tried first.
    """
    jump, jump_cost = price
    order = np.argsort(phi, kind="mergesort")
    best = np.full(len(link), np.inf)
    origin = np.zeros(len(link), np.int64)
    for j in range(len(link)):
        if link[j] >= 0:
            best[j], origin[j] = phi[link[j]], link[j]
        for i in order:
            if phi[i] + jump >= best[j]:
                break
            distance = 0.0
            for c in range(first.shape[1]):
                difference = last[i, c] - first[j, c]
                distance += difference * difference
            cost = phi[i] + jump + jump_cost * np.sqrt(distance)
            if cost < best[j] and i != link[j]:
                best[j], origin[j] = cost, i
    return best, origin


def best_path(steps: Sequence[Step], weights: Weights, *, start: int | None = None) -> tuple[NDArray[np.int64], float]:
    """The candidates [T] that minimise eq. 2, and their cost.

    The cost is a sum over steps, so that Viterbi's recursion over the candidates of each phone finds the global
    optimum in O(T n²) where the paper's queue of partial sequences grows exponentially. `start` prescribes the
    candidate of the first step.
    """
    phi = weights.target(steps[0])
    if start is not None:
        phi = np.where(np.arange(len(phi)) == start, phi, np.inf)
    origins = []
    for before, step in pairwise(steps):
        reached, origin = _advance(phi, before.last, step.first, step.link, (weights.jump, weights.jump_cost))
        phi = reached + weights.target(step)
        origins.append(origin)
    path = [int(phi.argmin())]
    for origin in reversed(origins):
        path.append(int(origin[path[-1]]))
    return np.array(path[::-1]), float(phi.min())


class LookAhead:
    """Steps in, candidates out: each is the first of the best path over it and the phones ahead.

    `push` returns the candidate that the newest step settles, if there is one; `finish` returns the rest.
    """

    def __init__(self, weights: Weights, phones: int) -> None:
        if phones < 1:
            raise FacesynthError(f"look-ahead must be at least 1 phone (the paper has 3 to 6); got {phones}")
        self.weights, self.phones = weights, phones
        self._window: list[Step] = []
        self._settled: int | None = None

    def push(self, step: Step) -> list[int]:
        """Add the next phone's candidates."""
        self._window.append(step)
        return [self._settle()] if len(self._window) - self._history > self.phones else []

    def finish(self) -> list[int]:
        """Settle what is left when the input ends."""
        return [self._settle() for _ in range(len(self._window) - self._history)]

    @property
    def _history(self) -> int:
        return 0 if self._settled is None else 1

    def _settle(self) -> int:
        path, _ = best_path(self._window, self.weights, start=self._settled)
        chosen = int(path[self._history])
        if self._history:
            self._window.pop(0)
        self._settled = chosen
        return chosen


def look_ahead_path(steps: Sequence[Step], weights: Weights, phones: int) -> NDArray[np.int64]:
    """The candidates [T] that `LookAhead` settles on."""
    search = LookAhead(weights, phones)
    settled = [candidate for step in steps for candidate in search.push(step)]
    return np.array(settled + search.finish())


def path_cost(steps: Sequence[Step], path: NDArray[np.int64], weights: Weights) -> float:
    """Eq. 2 of any path [T]."""
    cost = sum(float(weights.target(step)[c]) for step, c in zip(steps, path, strict=True))
    for t, (i, j) in enumerate(pairwise(path)):
        if steps[t + 1].link[j] != i:
            cost += weights.jump + weights.jump_cost * float(np.linalg.norm(steps[t].last[i] - steps[t + 1].first[j]))
    return cost


def jumps(steps: Sequence[Step], path: NDArray[np.int64]) -> NDArray[np.bool_]:
    """[T - 1] whether the step after each phone of a path is a jump."""
    return np.array([steps[t + 1].link[path[t + 1]] != path[t] for t in range(len(path) - 1)], bool)
