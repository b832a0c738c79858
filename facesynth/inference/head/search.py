"""The path through recorded head movements: near in sound, smooth, and on the way to key poses (Deng 2006, eq. 4.3 to 4.11).

For frame i and its j-th nearest recorded movement TV_ij, all norms unsquared and in training standard deviations,

    NE_ij = |c_ij - f_i|                    how far its sound is from the one heard                     (4.3)
    RE_ij = |TV_ij - V_i-1|                 the change of movement                                      (4.4)
    AE_ij = |KP - (P_i-1 + TV_ij)|          how far the pose is then from the next key pose             (4.5)

    ERR_lj = min_m ERR_l-1,m - Wa AE_l-1,m + Wr RE_lj + Wa AE_lj + Wn NE_lj                              (4.7)

Of the distances to a key pose only the newest counts, and that of the key pose's own frame stays: over a whole path the cost is
the sum of Wn NE + Wr RE and of Wa AE at each key pose and at the end. P, and so AE, depends on the whole path. For each candidate
the best paths are kept with their poses: one, as in the dissertation, is exact for Wa = 0; with enough of them every search is.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints


@dataclass(frozen=True, eq=False)
class Candidates:
    """Recorded movements for T frames."""

    distances: Floats
    """[T, K] NE, in the features' standard deviation."""
    moves: Floats
    """[T, K, 6] relative poses (rad, mm)."""
    targets: Floats
    """[T, 6] the next key pose at each frame."""
    keyed: NDArray[np.bool_]
    """[T] frames that have a key pose themselves."""


@dataclass(frozen=True, eq=False)
class Scales:
    """Training standard deviations that norms are measured in."""

    move: Floats
    """[6] of relative poses."""
    pose: Floats
    """[6] of poses."""


class PathSearch:
    """One search for each row of weights [W, 3] (Wn, Wr, Wa), all in step; frames come one by one."""

    def __init__(self, weights: Floats, start: Floats, scales: Scales, beam: int) -> None:
        self._wn, self._wr, self._wa = (np.asarray(weights, np.float64)[:, k, None, None] for k in range(3))
        count = len(weights)
        self._scales, self._beam = scales, beam
        self._cost, self._away = np.zeros((count, 1)), np.zeros((count, 1))
        self._pose = np.broadcast_to(start / scales.pose, (count, 1, 6)).copy()
        self._move: Floats | None = None
        self._keyed = False
        self.frames = 0

    def step(self, distances: Floats, moves: Floats, target: Floats, keyed: bool) -> Ints:
        """One frame with K candidates: for each path kept [W, B K], which of the paths before it goes on.

        Path s ends with candidate s % K.
        """
        onward = (moves / self._scales.pose)[None, None] + self._pose[:, :, None]
        away = self._wa * np.linalg.norm(target / self._scales.pose - onward, axis=-1)
        cost = (self._cost - (0.0 if self._keyed else self._away))[:, :, None] + away + self._wn * distances
        if self._move is not None:
            change = (moves / self._scales.move)[None, None] - self._move[:, :, None]
            cost = cost + self._wr * np.linalg.norm(change, axis=-1)
        best = np.argsort(cost, axis=1, kind="stable")[:, : self._beam] if self._beam > 1 else cost.argmin(axis=1)[:, None]
        rows, columns = np.arange(len(cost))[:, None, None], np.arange(cost.shape[2])
        shape = (len(cost), -1)
        self._cost = cost[rows, best, columns].reshape(shape)
        self._away = away[rows, best, columns].reshape(shape)
        self._pose = onward[rows, best, columns].reshape(*shape, 6)
        self._move = np.broadcast_to(moves / self._scales.move, (*best.shape, 6)).reshape(*shape, 6)
        self._keyed = keyed
        self.frames += 1
        return best.reshape(shape)

    @property
    def costs(self) -> Floats:
        """[W, S] of the paths so far; infinite for those that were given up."""
        return self._cost

    def give_up(self, paths: NDArray[np.bool_]) -> None:
        """Follow some paths [W, S] no further."""
        self._cost = np.where(paths, np.inf, self._cost)


def best_paths(candidates: Candidates, weights: Floats, start: Floats, scales: Scales, beam: int) -> tuple[Floats, Ints]:
    """Costs [W] and chosen candidates [W, T] of the best paths for weights [W, 3]."""
    search = PathSearch(weights, start, scales, beam)
    frames = zip(candidates.distances, candidates.moves, candidates.targets, candidates.keyed, strict=True)
    before = [search.step(*frame) for frame in frames]
    rows, number = np.arange(len(weights)), candidates.distances.shape[1]
    at = search.costs.argmin(axis=1)
    costs, chosen = search.costs[rows, at], np.empty((len(weights), len(before)), np.int64)
    for t in range(len(before) - 1, -1, -1):
        chosen[:, t], at = at % number, before[t][rows, at]
    return costs, chosen


def poses_along(candidates: Candidates, chosen: Ints, start: Floats) -> Floats:
    """[T, 6] the sum of the chosen movements [T] from a start pose [6] (eq. 4.11)."""
    return np.asarray(start + np.cumsum(candidates.moves[np.arange(len(chosen)), chosen], axis=0))
