"""The cheapest path, exactly, looking at few of the nodes.

phi_t(j) = min over i of [phi_t-1(i) + TC(i, j)] + target_t(j). Three passes find the best path to the newest phone:

* as phones come, a lower bound of phi is kept for every node (`StepBounds.forward`), and beside it a beam: a few nodes
  whose paths are real ones, so that their costs are upper bounds;
* backwards, the least that is still to come bounds what a path through a node costs in all; nodes for which that exceeds
  the beam's best path are left out, which are nearly all;
* forwards again, phi is computed exactly for the nodes that are left. Predecessors are sorted by phi + the cost of the
  joint, by matrix products; the costly bending is computed from the front until nothing better can follow.

That is done every few phones, for bounds upon bounds grow loose. What was computed once is kept: when a phone is added, only
nodes that were left out before may have to be looked at.
`settle` fixes a node and forgets what lies before it, so that an input without an end costs the same at every phone.
Bounds are compared with a margin for rounding; ties go to the node of the lowest number. numpy pays for each call: all is
in batches.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..efase.bounds import StepBounds, class_order
from ..efase.costs import Weights
from ..efase.nodes import Nodes
from ..efase.steps import bends, end_vectors, squared_distances, start_vectors, step_costs
from ..errors import FacesynthError

BEAM = 32
"""Nodes with real paths that are kept at each phone."""
TRIED = 2
"""Predecessors of each node that the beam tries, the nearest ones."""
CHUNK = 6
"""Predecessors of each node whose bending is computed at once."""
ROUNDING = 1e-9
"""By which squared distances from matrix products are lowered, relative to the vectors."""
MARGIN = 1e-5
"""Of upper bounds: tables and bounds are in single precision."""
MANY = 300
"""Nodes a phone, on average, for which a better upper bound is worth looking for."""
REJOINED = 4
"""Phones back to where a path is looked for that reaches a node which the beam did not expect."""
WIDE, BENT = 2000, 256
"""Nodes at each of those that it may go through, and those of them whose bending is computed."""
FEW = 4
"""Nodes to which steps are computed one by one, in place of bounds of classes."""
PAIRS = 1 << 19
"""Pairs of nodes that are looked at together, so that no constraint takes memory without end."""
ASTRAY = 0.5
"""How far, in PNT, the beam may be above the bound: a phone said with the wrong neighbours costs PNT."""
EVERY = 8
"""Phones after which what may be on the best path so far is made exact: bounds upon bounds grow loose."""
UNKNOWN, START = -2, -1
"""In place of a predecessor."""

Engine = Callable[[Floats], Ints]
"""Whatever finds the cheapest path: target costs [T, N] to a node for each phone [T]; ties go to the lowest node."""


class SearchIndex:
    """What can be prepared before the input is known: nodes sorted by class, and bounds; its size grows with N."""

    def __init__(self, nodes: Nodes, weights: Weights, tables: Mapping[str, NDArray[Any]]) -> None:
        """tables: those of `step_bounds` for these nodes and weights."""
        self.order = class_order(nodes)
        self.place = np.argsort(self.order)
        self.nodes, self.weights = nodes.take(self.order), weights
        self.bounds = StepBounds(self.nodes, weights, tables)

    def cheapest_path(self, targets: Floats) -> Ints:
        """[T] the nodes of the path of least COST, by target costs [T, N]; an `Engine`."""
        search = Search(self)
        for target in targets:
            search.push(target)
        return search.path()


@dataclass(eq=False)
class Position:
    """What is known at one phone."""

    targets: Floats
    """[N] target cost of each node."""
    phi: Floats
    """[N] exact where `back` is known, elsewhere a lower bound."""
    back: NDArray[np.int32]
    """[N] best predecessor."""
    beam: Ints = field(default_factory=lambda: np.zeros(0, np.int64))
    upper: Floats = field(default_factory=lambda: np.zeros(0))
    """[K] cost of a path to each node of the beam."""


@dataclass(frozen=True, eq=False)
class Kept:
    """Nodes that may be on the best path."""

    nodes: Ints
    unknown: NDArray[np.bool_]
    """[n] whose phi must be computed."""
    rest: Floats
    """[n] what a path costs at least after the node."""


class Search:
    """`push` phones; `path` is the best so far."""

    def __init__(self, index: SearchIndex) -> None:
        self.index, self.nodes, self.bounds, self.weights = index, index.nodes, index.bounds, index.weights
        self.positions: list[Position] = []

    def __len__(self) -> int:
        return len(self.positions)

    def begun(self, count: int) -> Self:
        """A search whose first `count` phones are those of this one, with all that is known of them.

        What is known of a phone, exact or a bound, holds whatever follows it: both searches may go on, and each gains by what
        the other finds of the phones that they share. Not after `settle`.
        """
        other = type(self)(self.index)
        other.positions = self.positions[:count]
        return other

    def push(self, targets: Floats) -> None:
        """The next phone, by the target cost [N] of every node."""
        targets, back = targets[self.index.order], np.full(len(self.nodes), UNKNOWN, np.int32)
        phi = targets
        if self.positions:
            phi = targets + self.bounds.forward(self.positions[-1].phi)
        else:
            back[:] = START
        here = Position(targets, phi, back)
        here.beam, here.upper = self._beam(here)
        self.positions.append(here)
        if len(self) % EVERY == 0 or self._astray(here):
            self._solve()

    def _astray(self, here: Position) -> bool:
        """Whether the beam lost its way, as it may at a hard constraint: far above the bound, or too narrow to be one."""
        return len(here.upper) < BEAM or float(here.upper.min() - here.phi.min()) > ASTRAY * self.weights.pnt

    def path(self) -> Ints:
        """[T] the nodes of the cheapest path to the newest phone."""
        return self.trace(len(self))

    def trace(self, count: int) -> Ints:
        """[count] the last nodes of that path."""
        self._solve()
        last = self.positions[-1]
        node, found = self._first_of_least(np.where(last.back == UNKNOWN, np.inf, last.phi), np.arange(len(self.nodes))), []
        for position in self.positions[: -count - 1 : -1]:
            found.append(node)
            node = int(position.back[node])
        return self.index.order[np.array(found[::-1], np.int64)]

    def _first_of_least(self, cost: Floats, which: Ints) -> int:
        """Of the nodes `which` [n] that of least cost [n]; of those, the one of the lowest number."""
        tied = which[cost == cost.min()]
        return int(tied[self.index.order[tied].argmin()])

    def settle(self, node: int, ahead: int) -> None:
        """From now on all paths go through `node`, of the last path `trace`, `ahead` phones before the newest one.

        What lies before that is forgotten, and costs count from there. Bounds stay bounds, since fewer paths are left;
        what is exact stays so where its path goes through the node.
        """
        del self.positions[: -ahead - 1]
        first, node = self.positions[0], int(self.index.place[node])
        cost = float(first.phi[node])
        first.phi, first.back = np.full(len(self.nodes), np.inf), np.full(len(self.nodes), UNKNOWN, np.int32)
        first.phi[node], first.back[node] = 0.0, START
        first.beam, first.upper = np.array([node]), np.zeros(1)
        for before, here in pairwise(self.positions):
            here.phi -= cost
            known = np.flatnonzero(here.back != UNKNOWN)
            here.back[known[before.back[here.back[known]] == UNKNOWN]] = UNKNOWN
            known = np.flatnonzero(here.back != UNKNOWN)
            here.beam = known[np.argsort(here.phi[known], kind="stable")[:BEAM]]
            here.upper = here.phi[here.beam]

    def _beam(self, here: Position) -> tuple[Ints, Floats]:
        """Real paths to nodes of small bounds and to those that were recorded after the last beam."""
        phi, wide = here.phi, min(BEAM, len(here.phi))
        chosen = np.argpartition(phi, wide - 1)[:wide]
        if not self.positions:
            return chosen, phi[chosen]
        last = self.positions[-1]
        chosen = np.union1d(chosen, self.bounds.following(last.beam))
        chosen = chosen[phi[chosen] < np.inf]
        upper = self._reached(last.beam, last.upper, chosen) + here.targets[chosen]
        best = np.argsort(upper, kind="stable")[:BEAM]
        return chosen[best], upper[best]

    def _reached(self, i: Ints, phi: Floats, j: Ints) -> Floats:
        """[m] costs of paths to the nodes j, each through one of the predecessors that look best."""
        nodes = self.nodes
        costs = phi + self._joints(i, j)
        wide = min(TRIED, len(i))
        tried = np.argpartition(costs, wide - 1, axis=1)[:, :wide]
        steps = step_costs(nodes, i[tried].ravel(), np.repeat(j, wide), self.weights).reshape(tried.shape)
        best = (phi[tried] + steps).min(axis=1)
        place = np.full(len(nodes) + 1, -1)
        place[i] = np.arange(len(i))
        captured = place[nodes.before[j]]
        return np.minimum(best, np.where(captured >= 0, phi[captured], np.inf))

    def _joints(self, i: Ints, j: Ints) -> Floats:
        """[m, n] cost of the joint from each i to each j, rounded down, and of another viseme class."""
        nodes = self.nodes
        cost = squared_distances(start_vectors(nodes, j, self.weights), end_vectors(nodes, i, self.weights), ROUNDING)
        cost += np.where(nodes.visemes[nodes.before[j]][:, None] == nodes.visemes[i], 0.0, self.weights.pnt)
        return cost

    def _solve(self) -> None:
        """Make phi known for every node at the newest phone that may be its best, and for all on the way there."""
        limit = _limit(self.positions[-1].upper)
        if len(self) > 1 and self._astray(self.positions[-1]):
            limit = min(limit, _limit(self._rejoined()))
        kept = self._backwards(limit)
        if sum(len(some.nodes) for some in kept) > MANY * len(kept):
            phi = self.positions[-len(kept)].phi[kept[0].nodes]  # known, or none where all that counts is known later
            near = _least(phi + kept[0].rest, 2 * BEAM)
            limit = min(limit, _limit(self._led(kept[1:], kept[0].nodes[near], phi[near])))
            kept = self._backwards(limit)
        for t in range(len(self) - len(kept) + 1, len(self)):
            self._forwards(t, kept[t - len(self) - 1].nodes, kept[t - len(self)], limit)
        self._widen(self.positions[-1])

    def _widen(self, here: Position) -> None:
        """The beam goes on from what is exact, too."""
        known = np.flatnonzero(here.back != UNKNOWN)
        known = known[_least(here.phi[known], BEAM)]
        beam, upper = np.concatenate([known, here.beam]), np.concatenate([here.phi[known], here.upper])
        order = np.argsort(upper, kind="stable")
        beam, first = np.unique(beam[order], return_index=True)
        best = order[first][np.argsort(upper[order[first]], kind="stable")[:BEAM]]
        here.beam, here.upper = np.concatenate([known, here.beam])[best], upper[best]

    def _rejoined(self) -> Floats:
        """Costs of paths to the newest phone, found from its end: its nearest nodes, what leads best to them, and so on.

        A few phones back it joins the beam of there, which did not know of what came.
        """
        last, before = self.positions[-1], self.positions[-2 : -2 - REJOINED : -1]
        j = _least(last.phi, FEW)
        value, sets = last.targets[j], [Kept(j, np.ones(len(j), bool), np.zeros(len(j)))]
        for position in before:
            i = _least(position.phi, WIDE)
            i = i[_least(position.phi[i] + self._onward(i, j, value, bent=False), BENT)]
            rest = self._onward(i, j, value)
            near = np.argsort(position.phi[i] + rest, kind="stable")[: 2 * BEAM]
            sets.append(Kept(i[near], np.ones(len(near), bool), rest[near]))
            j, value = i[near[:FEW]], rest[near[:FEW]] + position.targets[i[near[:FEW]]]
        first = self.positions[-len(sets)]
        if len(sets) == len(self):
            start = sets.pop().nodes
            return self._led(sets[::-1], start, first.phi[start])
        joined = self.positions[-len(sets) - 1]
        return self._led(sets[::-1], joined.beam, joined.upper)

    def _led(self, kept: list[Kept], i: Ints, phi: Floats) -> Floats:
        """Costs of paths to the newest phone, found by a beam that knows both bounds: where the first beam went astray.

        kept: of the last phones; i and phi [n]: nodes, and what paths to them cost, of the phone before those.
        """
        for position, some in zip(self.positions[len(self) - len(kept) :], kept, strict=True):
            whole = position.phi[some.nodes] + some.rest
            j = some.nodes[np.argsort(whole, kind="stable")[: 2 * BEAM]]
            j = np.union1d(j, np.intersect1d(self.bounds.following(i), some.nodes))
            reached = self._reached(i, phi, j) + position.targets[j] if len(i) else np.full(len(j), np.inf)
            phi = np.where(position.back[j] == UNKNOWN, reached, position.phi[j])
            best = np.argsort(phi, kind="stable")[: 2 * BEAM]
            best = best[phi[best] < np.inf]
            i, phi = j[best], phi[best]
        return phi if len(phi) else np.full(1, np.inf)

    def _backwards(self, limit: float) -> list[Kept]:
        """Nodes of the last positions, in the order of time, until all of them are known."""
        last = self.positions[-1]
        nodes = np.flatnonzero(last.phi <= limit)
        found = [Kept(nodes, last.back[nodes] == UNKNOWN, np.zeros(len(nodes)))]
        for position, after in zip(self.positions[-2::-1], self.positions[:0:-1], strict=True):
            j = found[-1].nodes[found[-1].unknown]
            if not len(j):
                break
            value = found[-1].rest[found[-1].unknown] + after.targets[j]
            i = np.flatnonzero(position.phi <= limit - value.min())
            rest = self._onward(i, j, value) if len(j) <= FEW else self.bounds.backward(j, value, i)
            left = position.phi[i] + rest <= limit
            found.append(Kept(i[left], position.back[i[left]] == UNKNOWN, rest[left]))
        return found[::-1]

    def _onward(self, i: Ints, j: Ints, value: Floats, bent: bool = True) -> Floats:
        """[n] min over few nodes j [m] of TC(i, j) + value(j), rounded down, for the nodes i [n]; bent: with the bending.

        A hard constraint may be far from all that is near otherwise. The bounds of classes know of a class what its nearest
        node costs, and would leave half of the database to be looked at before such a node.
        """
        nodes, w, least = self.nodes, self.weights, np.full(len(i), np.inf)
        for node, after, cost in zip(j.tolist(), value.tolist(), self._joints(i, j), strict=True):
            before = int(nodes.before[node])
            if before < 0:
                least = np.minimum(least, after + w.alpha * w.pnt)
                continue
            alike = np.flatnonzero(nodes.visemes[i] == nodes.visemes[before])
            if bent and len(alike):
                cost[alike] += w.beta * bends(nodes, i[alike], np.array([before]))[:, 0] * (1 - MARGIN)
            cost[i == before] = 0.0
            least = np.minimum(least, after + cost)
        return least

    def _forwards(self, t: int, i: Ints, kept: Kept, limit: float) -> None:
        """phi of the nodes that are not known at position t, from the nodes i before it."""
        last, here = self.positions[t - 1], self.positions[t]
        i = i[last.back[i] != UNKNOWN]
        j, rest = kept.nodes[kept.unknown], kept.rest[kept.unknown]
        if not len(j) or not len(i):
            here.phi[j] = np.maximum(here.phi[j], limit - rest)
            return
        target = here.targets[j]
        most = limit - rest - target
        parts = np.array_split(np.arange(len(j)), -(-len(i) * len(j) // PAIRS))
        found = [self._cheapest(i, last.phi[i], j[part], most[part]) for part in parts]
        best, origin = (np.concatenate(column) for column in zip(*found, strict=True))
        phi, exact = best + target, best + target + rest <= limit
        here.phi[j] = np.where(exact, phi, np.maximum(here.phi[j], limit - rest))
        here.back[j[exact]] = origin[exact]

    def _cheapest(self, i: Ints, phi: Floats, j: Ints, limit: Floats) -> tuple[Floats, Ints]:
        """[m] least phi(i) + TC(i, j), and where from; only what is within the limits [m] is looked for."""
        nodes, captured = self.nodes, self.nodes.before[j]
        place = np.full(len(nodes) + 1, -1)
        place[i] = np.arange(len(i))
        before = place[captured]
        best, origin = np.where(before >= 0, phi[before], np.inf), captured.copy()
        orphan = captured < 0
        best[orphan], origin[orphan] = phi.min() + self.weights.alpha * self.weights.pnt, self._first_of_least(phi, i)
        lowest = phi + self._joints(i, j)
        lowest[orphan] = np.inf
        lowest[np.flatnonzero(before >= 0), before[before >= 0]] = np.inf
        rows = np.arange(len(j))
        self._try(rows, lowest.argmin(axis=1), lowest, i, phi, j, best, origin)
        row, column = np.nonzero(lowest <= np.minimum(best, limit)[:, None])
        order = np.lexsort((lowest[row, column], row))
        row, column = row[order], column[order]
        rank = np.arange(len(row)) - np.searchsorted(row, row)  # the nearest predecessor of each row first, then the next ones
        for start in range(0, int(rank.max(initial=-1)) + 1, CHUNK):
            left = lowest[row, column] <= np.minimum(best, limit)[row]
            row, column, rank = row[left], column[left], rank[left]
            now = rank < start + CHUNK
            self._try(row[now], column[now], lowest, i, phi, j, best, origin)
        return best, origin

    def _try(self, row: Ints, column: Ints, lowest: Floats, i: Ints, phi: Floats, j: Ints, best: Floats, origin: Ints) -> None:
        """Compute the pairs (i[column], j[row]) exactly, and take them off `lowest`."""
        numbers, usable = self.index.order, lowest[row, column] < np.inf
        row, column = row[usable], column[usable]
        cost = phi[column] + step_costs(self.nodes, i[column], j[row], self.weights)
        lowest[row, column] = np.inf
        order = np.lexsort((numbers[i[column]], cost, row))
        row, column, cost = row[order], column[order], cost[order]
        ahead = np.concatenate([[True], row[1:] != row[:-1]])[: len(row)]
        row, node, cost = row[ahead], i[column[ahead]], cost[ahead]
        better = (cost < best[row]) | ((cost == best[row]) & (numbers[node] < numbers[origin[row]]))
        best[row[better]], origin[row[better]] = cost[better], node[better]


def _least(values: Floats, count: int) -> Ints:
    """Where the least values are, at most so many, and none that are infinite."""
    chosen = np.argpartition(values, count - 1)[:count] if len(values) > count else np.arange(len(values))
    return chosen[values[chosen] < np.inf]


def _limit(upper: Floats) -> float:
    """The least of upper bounds, with a margin."""
    least = float(upper.min())
    return least + MARGIN * max(abs(least), 1e-3)


class Stretch:
    """A run of phones that is searched as one; with a look-ahead, nodes are settled as it goes.

    With a look-ahead of n, the phone n before the newest one is settled on the best path that goes on from the node settled
    before it. Nothing older is looked at again.
    """

    def __init__(self, index: SearchIndex, look_ahead: int | None) -> None:
        if look_ahead is not None and look_ahead < 1:
            raise FacesynthError(f"look_ahead is {look_ahead}; wanted at least 1 phone, or None for the whole search")
        self.search, self.look_ahead = Search(index), look_ahead
        self.settled: list[int] = []
        self.pushed = 0

    def push(self, targets: Floats) -> None:
        """The next phone, by the target cost [N] of every node."""
        self.search.push(targets)
        self.pushed += 1
        if self.look_ahead is not None and self.pushed > self.look_ahead:
            self.settled.append(int(self.search.trace(self.look_ahead + 1)[0]))
            self.search.settle(self.settled[-1], self.look_ahead)

    def finish(self) -> Ints:
        """[P] a node for each phone."""
        if not self.pushed:
            return np.zeros(0, np.int64)
        rest = self.search.trace(self.pushed - len(self.settled))
        return np.concatenate([np.array(self.settled, np.int64), rest])
