"""Searching for a whole input: one search for each stretch of speech between silences.

The database has no silence, and a node recorded right after a pause has no predecessor. With `pau`
as a step of the search, as the paper writes it, such a node costs alpha · PNT exactly where it fits
best, so by default each stretch between silences is searched for itself, which also keeps the memory
of a long input small. `bridge_pauses` gives the paper's reading.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..efase.costs import Query, Weights, all_targets
from ..efase.nodes import Floats, Ints, Nodes
from ..efase.search import Engine
from ..efase.soft import Mixture
from ..efase.steps import path_cost


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


Soften = Callable[[Query, Floats, Ints], Sequence[Mixture]]
"""Query, target costs [T, N] and cheapest path [T] to what stands beside that path."""


def plan_speech(
    nodes: Nodes, query: Query, weights: Weights, engine: Engine, soften: Soften | None = None, *, bridge_pauses: bool
) -> Plan:
    """Search each stretch of the query, or all of it at once."""
    found = np.full(len(query), -1, np.int64)
    mixtures: list[Mixture | None] = [None] * len(query)
    cost = 0.0
    for places in [np.arange(len(query))] if bridge_pauses else stretches(query.phones):
        asked = query.part(places)
        targets = all_targets(nodes, asked, weights)
        found[places] = path = engine(targets)
        cost += path_cost(nodes, asked, path, weights)
        if soften is not None:
            mixtures[places[0] : places[-1] + 1] = soften(asked, targets, path)
    return Plan(query, found, cost, None if soften is None else tuple(mixtures))


def stretches(phones: Ints) -> list[Ints]:
    """Positions of each run of phones that are not silence (-1)."""
    spoken = np.flatnonzero(phones >= 0)
    return [run for run in np.split(spoken, np.flatnonzero(np.diff(spoken) > 1) + 1) if len(run)]
