"""The cheapest path, exactly, one phone at a time, looking at few of the pairs.

phi_t(j) = min over i of [phi_t-1(i) + TC(i, j)] + target_t(j) is computed only for the nodes that may matter; all others
keep a lower bound that costs O(1) each (see facesynth's search, whose bound this is). Where a node does matter, its
predecessors are sorted by phi + the cost of the joint, which matrix products give for all of them; the costly bending is
computed from the front until nothing better can follow, and predecessors that are themselves only bounded are computed
when they come first. Everything is float64 and in batches, because numpy pays for each call.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from facesynth_runtime.efase.nodes import Floats, Ints, Nodes, Query

BATCH = 24
"""Nodes evaluated at once when the smallest phi is looked for; doubled from round to round."""
CHUNK = 6
"""Predecessors of each node whose bending is computed at once."""
ROUNDING = 1e-9
"""By which squared distances from matrix products are lowered, relative to the vectors."""

Request = tuple[int, Ints]
"""Position and nodes whose phi must be known."""


class Search:
    """`push` phones; `path` is the best so far."""

    def __init__(self, nodes: Nodes) -> None:
        self.nodes = nodes
        self.queries: list[Query] = []
        self.phi: list[Floats] = []
        self.known: list[NDArray[np.bool_]] = []
        self.back: list[NDArray[np.int32]] = []
        self.least: list[int] = []
        """The node of smallest phi at each position."""
        self._targets: list[Floats] = []
        self._rising: list[tuple[Ints, Floats]] = []
        """Of each position: nodes by rising phi, as it was known when the position was settled, and that phi."""

    def push(self, query: Query) -> None:
        """The next phone."""
        t, nodes = len(self.queries), self.nodes
        self.queries.append(query)
        target, back = nodes.targets(query), np.full(len(nodes), -1, np.int32)
        phi = target.copy()
        known = np.ones(len(nodes), bool) if t == 0 else nodes.before < 0
        if t:
            phi += self._bounds(t)
            back[known] = self.least[t - 1]
        self._targets.append(target)
        self.phi.append(phi)
        self.known.append(known)
        self.back.append(back)
        self.least.append(self._settle_least(t))
        order = np.flatnonzero(phi < np.inf)
        order = order[np.argsort(phi[order], kind="stable")]
        self._rising.append((order, phi[order]))

    def path(self) -> Ints:
        """[T] the nodes of the cheapest path to the newest phone; ties go to the lowest node."""
        return self.trace(len(self.queries))

    def trace(self, count: int) -> Ints:
        """[count] the last nodes of that path."""
        node, nodes = self.least[-1], []
        for t in range(len(self.queries) - 1, len(self.queries) - 1 - count, -1):
            nodes.append(node)
            node = int(self.back[t][node])
        return np.array(nodes[::-1], np.int64)

    def cost(self, path: Ints) -> float:
        """The whole COST of a path [T]."""
        targets = sum(float(self.nodes.targets(query)[node]) for query, node in zip(self.queries, path, strict=True))
        return targets + float(self.nodes.steps(path[:-1], path[1:]).sum())

    def _bounds(self, t: int) -> Floats:
        """[N] what phi_t costs at least, the target left out."""
        nodes, phi, w = self.nodes, self.phi[t - 1], self.nodes.weights
        least = phi[self.least[t - 1]]
        by_viseme = np.full(int(nodes.visemes.max()) + 1, np.inf)
        np.minimum.at(by_viseme, nodes.visemes, phi)
        alike = by_viseme[nodes.visemes[nodes.before]] + nodes.nearest
        bound = np.minimum(np.minimum(phi[nodes.before], alike), least + w.pnt)
        return np.where(nodes.before < 0, least + w.alpha * w.pnt, bound)

    def _settle_least(self, t: int) -> int:
        phi, known, batch = self.phi[t], self.known[t], BATCH
        while True:
            least = np.where(known, phi, np.inf).min()
            asked = np.flatnonzero(~known & (phi <= least) & (phi < np.inf))
            if not len(asked):
                return int(np.flatnonzero(known & (phi == least))[0]) if least < np.inf else int(phi.argmin())
            asked = asked[np.argsort(phi[asked], kind="stable")[:batch]]
            self._require(t, asked)
            batch *= 2

    def _require(self, t: int, asked: Ints) -> None:
        """Make phi known; evaluations that wait for earlier positions are piled up, not nested."""
        pile = [self._evaluate(t, asked)]
        while pile:
            request = next(pile[-1], None)
            if request is None:
                pile.pop()
            else:
                pile.append(self._evaluate(*request))

    def _evaluate(self, t: int, asked: Ints) -> Iterator[Request]:
        """phi_t of some nodes, those that share the viseme class before them together."""
        asked = asked[~self.known[t][asked]]
        classes = self.nodes.visemes[self.nodes.before[asked]]
        for viseme in np.unique(classes):
            yield from self._evaluate_alike(t, asked[classes == viseme], int(viseme))

    def _evaluate_alike(self, t: int, j: Ints, viseme: int) -> Iterator[Request]:
        nodes, phi, known = self.nodes, self.phi[t - 1], self.known[t - 1]
        captured = nodes.before[j]
        start = np.full(len(j), self.least[t - 1], np.int64)
        best, origin = phi[start] + nodes.steps(start, j), start
        best, origin = _better(best, origin, np.where(known[captured], phi[captured], np.inf), captured)
        i, k, joint, switch = self._promising(t, j, viseme, best)
        bent = np.full(len(i), np.nan)
        while True:
            # Per node j: its next CHUNK pairs that may still win; the captured predecessor is free.
            open_ = np.flatnonzero(np.isnan(bent) & (phi[i] + switch + joint <= best[k]))
            if len(open_):
                rank = np.arange(len(open_)) - np.searchsorted(k[open_], k[open_])
                now = open_[rank < CHUNK]
                exact = np.square(nodes.ends[i[now]] - nodes.joints[j[k[now]]]).sum(axis=1)
                joint[now] = exact
                bent[now] = nodes.weights.beta * nodes.bending(i[now], captured[k[now]])
                yield from self._improve(t, i[now], k[now], joint[now] + bent[now] + switch[now], best, origin)
                continue
            waiting = ~known[captured] & (phi[captured] <= best)
            if waiting.any():
                yield t - 1, np.unique(captured[waiting])
            # Known by now, or made known on the way.
            best[:], origin[:] = _better(best, origin, np.where(known[captured], phi[captured], np.inf), captured)
            if not waiting.any():
                break
        self.phi[t][j] = best + self._targets[t][j]
        self.back[t][j], self.known[t][j] = origin, True

    def _promising(self, t: int, j: Ints, viseme: int, best: Floats) -> tuple[Ints, Ints, Floats, Floats]:
        """Pairs (i, index into j) that may be cheaper than `best`, for each j by rising cost, without the bending.

        Beside them the cost of their joint, rounded down, and that of another viseme class.
        """
        nodes, (rising, phi) = self.nodes, self._rising[t - 1]
        i = rising[: np.searchsorted(phi, best.max(), side="right")]
        switch = np.where(nodes.visemes[i] == viseme, 0.0, nodes.weights.pnt)
        base = self.phi[t - 1][i] + switch
        kept = base <= best.max()
        i, switch, base = i[kept], switch[kept], base[kept]
        ends, joints = nodes.squares
        total = ends[i][:, None] + joints[j]
        squared = np.maximum(total * (1 - ROUNDING) - 2 * nodes.ends[i] @ nodes.joints[j].T, 0.0)
        lowest = base[:, None] + squared
        row, column = np.nonzero((lowest <= best) & (i[:, None] != nodes.before[j]))
        order = np.lexsort((lowest[row, column], column))
        row, column = row[order], column[order]
        return i[row], column, squared[row, column], switch[row]

    def _improve(self, t: int, i: Ints, k: Ints, step: Floats, best: Floats, origin: Ints) -> Iterator[Request]:
        """Take pairs (i, k) of known step costs into account; those that are only bounded are asked for, the best first."""
        phi, known = self.phi[t - 1], self.known[t - 1]
        left = np.ones(len(i), bool)
        while True:
            cost = phi[i] + step
            for at in np.flatnonzero(left & known[i] & (cost <= best[k])).tolist():
                if cost[at] < best[k[at]] or (cost[at] == best[k[at]] and i[at] < origin[k[at]]):
                    best[k[at]], origin[k[at]] = cost[at], i[at]
            left &= ~known[i] & (cost <= best[k])
            if not left.any():
                return
            waiting = np.flatnonzero(left)
            waiting = waiting[np.lexsort((cost[waiting], k[waiting]))]
            yield t - 1, np.unique(i[waiting[np.concatenate([[True], np.diff(k[waiting]) > 0])]])


def _better(best: Floats, origin: Ints, cost: Floats, node: Ints) -> tuple[Floats, Ints]:
    wins = (cost < best) | ((cost == best) & (node < origin))
    return np.where(wins, cost, best), np.where(wins, node, origin)
