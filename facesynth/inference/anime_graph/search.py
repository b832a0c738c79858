"""The path through the graph: globally optimal, a mean over all paths, or with a look-ahead of some phones (Cao 2005, §4.2)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..errors import FacesynthError
from ..posterior import posterior
from ..ragged import Made, Ragged


@dataclass(frozen=True)
class Weights:
    """Of eq. 2: jumps, their cost (RMS mm) and the audio cost; beyond the paper, of the expected pose."""

    jump: float = 100.0
    jump_cost: float = 1.0
    audio: float = 0.01
    pose: float = 0.0

    def target(self, step: "Step") -> Floats:
        """[n] what each candidate of a step costs, wherever one comes from."""
        cost = self.audio * step.audio
        return cost if step.pose is None else cost + self.pose * step.pose


@dataclass(frozen=True, eq=False)
class Step:
    """The n candidates for one phone of the input."""

    audio: Floats
    """[n] audio cost of each (eq. 5)."""
    first: Floats
    """[n, D] first frame of each, in coordinates whose Euclidean distance is the RMS distance of frames."""
    last: Floats
    """[n, D] last frame of each."""
    link: Ints
    """[n] the candidate of the phone before that was recorded just before this one, or -1."""
    pose: Floats | None = None
    """[n] mean squared distance of each from the pose that the sound leads one to expect; None where nothing predicts it."""


def best_path(steps: Sequence[Step], weights: Weights, *, start: int | None = None) -> tuple[Ints, float]:
    """The candidates [T] that minimise eq. 2, and their cost; of equal paths the one of the lowest candidates.

    The cost is a sum over steps, so that Viterbi's recursion over the candidates of each phone finds the global
    optimum in O(T n²) where the paper's queue of partial sequences grows exponentially. `start` prescribes the
    candidate of the first step.
    """
    phi = weights.target(steps[0])
    if start is not None:
        phi = np.where(np.arange(len(phi)) == start, phi, np.inf)
    origins = Ragged(np.int32)
    for before, step in pairwise(steps):
        reached, origin = _advance(phi, before, step, weights)
        phi = reached + weights.target(step)
        origins.add(origin)
    path = [int(phi.argmin())]
    for origin in reversed(origins):
        path.append(int(origin[path[-1]]))
    return np.array(path[::-1], np.int64), path_cost(steps, path[::-1], weights)


# One step of Viterbi: for each candidate j the least phi_i + (cost of the step i to j), and that i. A jump costs
# phi_i + jump + jump_cost ‖last_i - first_j‖. The jump from the cheapest i, or the captured predecessor, which is free,
# bounds what each j costs from above: only the i with phi_i + jump up to the largest of these bounds can win anywhere.
def _advance(phi: Floats, before: Step, step: Step, weights: Weights) -> tuple[Floats, Ints]:
    captured = np.where(step.link >= 0, phi[step.link], np.inf)
    cheapest = int(phi.argmin())
    nearest = np.linalg.norm(step.first - before.last[cheapest], axis=1)
    bounds = np.minimum(captured, phi[cheapest] + weights.jump + weights.jump_cost * nearest)
    kept = np.flatnonzero(phi + weights.jump <= bounds.max())
    if not len(kept):
        return captured, step.link
    jumped = phi[kept] + weights.jump + weights.jump_cost * _distances(step.first, before.last[kept])  # [n', kept]
    best = jumped.argmin(axis=1)
    least = jumped[np.arange(len(best)), best]
    return np.minimum(captured, least), np.where(captured <= least, step.link, kept[best])


def soft_path(steps: Sequence[Step], weights: Weights, temperature: float) -> Sequence[Floats]:
    """The posterior probability [n] of each candidate of each phone; temperature in the unit of eq. 2, above 0.

    The same recursion as in `best_path`, with `-tau log sum exp(-· / tau)` in the place of `min`; tau -> 0 is the
    cheapest path. A mean of many recorded phones is nearer to what is said than any of them, and moves less.
    """
    if not temperature > 0:
        raise FacesynthError(f"a soft search needs a temperature above 0; got {temperature:g}: take best_path instead")
    scores = Made(lambda t: -weights.target(steps[t]) / temperature, len(steps))
    moves = Made(lambda t: -step_costs(steps[t], steps[t + 1], weights) / temperature, len(steps) - 1)
    return posterior(scores, moves).shares()


def step_costs(before: Step, step: Step, weights: Weights) -> Floats:
    """[n, n'] what eq. 2 asks for the step from each candidate to each of the next phone; nothing where it was captured."""
    jumps, apart = step_terms(before, step)
    return weights.jump * jumps + weights.jump_cost * apart


def step_terms(before: Step, step: Step) -> tuple[Floats, Floats]:
    """[n, n'] 1 where a step is a jump, and how far apart the frames are that meet there; 0 where it was captured."""
    apart = _distances(before.last, step.first)
    jumps, linked = np.ones_like(apart), np.flatnonzero(step.link >= 0)
    jumps[step.link[linked], linked] = apart[step.link[linked], linked] = 0.0
    return jumps, apart


def _distances(a: Floats, b: Floats) -> Floats:
    """[n, m] ‖a_i - b_j‖ of the rows of a [n, D] and b [m, D]."""
    squared = np.square(a).sum(axis=1)[:, None] + np.square(b).sum(axis=1) - 2 * a @ b.T
    return np.sqrt(np.maximum(squared, 0.0))


class LookAhead:
    """Steps in, candidates out: each is the first of the best path over it and the phones ahead.

    `push` returns the candidate that the newest step settles, if there is one; `finish` returns the rest.
    """

    def __init__(self, weights: Weights, phones: int) -> None:
        if phones < 1:
            raise FacesynthError(f"look_ahead is {phones}; wanted at least 1 phone (the paper has 3 to 6)")
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


def look_ahead_path(steps: Sequence[Step], weights: Weights, phones: int) -> Ints:
    """The candidates [T] that `LookAhead` settles on."""
    search = LookAhead(weights, phones)
    settled = [candidate for step in steps for candidate in search.push(step)]
    return np.array(settled + search.finish(), np.int64)


def path_cost(steps: Sequence[Step], path: Sequence[int] | Ints, weights: Weights) -> float:
    """Eq. 2 of any path [T]."""
    cost = sum(float(weights.target(step)[c]) for step, c in zip(steps, path, strict=True))
    for t, (i, j) in enumerate(pairwise(path)):
        if steps[t + 1].link[j] != i:
            cost += weights.jump + weights.jump_cost * float(np.linalg.norm(steps[t].last[i] - steps[t + 1].first[j]))
    return cost


def jumps(steps: Sequence[Step], path: Ints) -> NDArray[np.bool_]:
    """[T - 1] whether the step after each phone of a path is a jump."""
    return np.array([steps[t + 1].link[path[t + 1]] != path[t] for t in range(len(path) - 1)], bool)


@dataclass(frozen=True)
class PathSearch:
    """An engine: what finds paths, on whatever device."""

    best_path: Callable[[Sequence[Step], Weights], tuple[Ints, float]]
    soft_path: Callable[[Sequence[Step], Weights, float], Sequence[Floats]]


NUMPY = PathSearch(best_path, soft_path)
"""The engine that is there everywhere."""
