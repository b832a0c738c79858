"""Searching for a whole input: one search for each stretch of speech between silences.

The database has no silence, and a node recorded right after a pause has no predecessor. With `pau`
as a step of the search, as the paper writes it, such a node costs alpha · PNT exactly where it fits
best, so by default each stretch between silences is searched for itself, which also keeps the memory
of a long input small. `bridge_pauses` gives the paper's reading.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Ints
from ..efase.costs import Query
from ..efase.soft import Mixture


@dataclass(frozen=True, eq=False)
class Plan:
    """The result of a search, before it becomes motion."""

    query: Query
    nodes: Ints
    """[P] a node for each phone of the input; -1 in silence between searches."""
    cost: float
    mixtures: tuple[Mixture | None, ...] | None = None
    """P mixtures of nodes, none in silence between searches; None where only the cheapest path counts."""
    expected: Floats | None = None
    """[T, D] pose that the sound leads one to expect of each frame; None where nothing predicts it."""


@dataclass(frozen=True, eq=False)
class Solved:
    """The result of one search."""

    path: Ints
    """[T] a node for each phone."""
    cost: float
    mixtures: Sequence[Mixture] | None = None
    """T mixtures of nodes; None where only the cheapest path counts."""


Solve = Callable[[Query], Solved]


def plan_speech(query: Query, solve: Solve, *, bridge_pauses: bool) -> Plan:
    """Search each stretch of the query, or all of it at once."""
    found = np.full(len(query), -1, np.int64)
    mixtures: list[Mixture | None] = [None] * len(query)
    cost, soft = 0.0, False
    for places in [np.arange(len(query))] if bridge_pauses else stretches(query.phones):
        solved = solve(query.part(places))
        found[places] = solved.path
        cost += solved.cost
        if solved.mixtures is not None:
            soft, mixtures[places[0] : places[-1] + 1] = True, solved.mixtures
    return Plan(query, found, cost, tuple(mixtures) if soft else None)


def stretches(phones: Ints) -> list[Ints]:
    """Positions of each run of phones that are not silence (-1)."""
    spoken = np.flatnonzero(phones >= 0)
    return [run for run in np.split(spoken, np.flatnonzero(np.diff(spoken) > 1) + 1) if len(run)]
