"""What is asked for, and what a node costs as an answer (Deng 2008, eq. 3-12).

`COST = sum_t TC(o_t, o_t+1) + sum_t [OC(P_t, o_t) + EMP(E_t, o_t) + B(t, o_t)]`; `steps` has TC, the cost of a transition.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..efase.nodes import Nodes
from ..long_arrays import let_go


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

    def asked(self, t: int) -> tuple[object, ...]:
        """What is asked for at a position: where it is the same, so are the costs."""
        strict = self.strict is not None and bool(self.strict[t])
        asked = (int(self.phones[t]), int(self.visemes[t]), int(self.emotions[t]), strict, self.fixed.get(t))
        return asked if self.heard is None else (*asked, t)

    def part(self, places: Ints) -> "Query":
        """The query at consecutive positions."""
        first = int(places[0])
        fixed = {t - first: node for t, node in self.fixed.items() if first <= t <= places[-1]}
        strict = None if self.strict is None else self.strict[places]
        heard = None if self.heard is None else self.heard[places]
        if self.heard is not None:
            let_go(self.heard)
        return Query(self.phones[places], self.visemes[places], self.emotions[places], fixed, strict, heard)


def target_costs(nodes: Nodes, query: Query, t: int, weights: Weights) -> Floats:
    """[N] OC + EMP + B, and the audio cost, of every node at position t; infinite where a hard constraint forbids the node."""
    cost = np.zeros(len(nodes))
    same_viseme = nodes.visemes == query.visemes[t]
    if query.phones[t] >= 0:
        other = np.where(same_viseme, weights.gamma, 1.0) * weights.delta * weights.pnt
        cost += np.where(nodes.phones != query.phones[t], other, 0.0)
    if query.emotions[t] >= 0:
        cost += np.where(nodes.emotions != query.emotions[t], weights.phi * weights.pnt, 0.0)
    if query.heard is not None:
        cost += query.heard[t]
    if query.strict is not None and query.strict[t]:
        cost[~same_viseme] = np.inf
    if t in query.fixed:
        cost[np.arange(len(nodes)) != query.fixed[t]] = np.inf
    return cost


def all_targets(nodes: Nodes, query: Query, weights: Weights) -> Floats:
    """[T, N] `target_costs` of every position; those that ask for the same are computed once."""
    costs, known = np.empty((len(query), len(nodes))), dict[tuple[object, ...], int]()
    for t in range(len(query)):
        first = known.setdefault(query.asked(t), t)
        costs[t] = costs[first] if first < t else target_costs(nodes, query, t, weights)
    return costs
