"""Searching for a whole input: one search for each stretch of speech between silences.

The database has no silence, and a node recorded right after a pause has no predecessor. With `pau`
as a step of the search, as the paper writes it, such a node costs alpha · PNT exactly where it fits
best, so by default each stretch between silences is searched for itself, which also keeps the memory
of a long input small. `bridge_pauses` gives the paper's reading.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from facesynth.methods.efase.costs import Query
from facesynth.methods.efase.nodes import Floats, Ints
from facesynth.methods.efase.search import Path
from facesynth.methods.efase.soft import Mixture


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


def plan_speech(
    query: Query,
    search: Callable[[Query], Path],
    soften: Callable[[Query, Path], Sequence[Mixture]] | None = None,
    *,
    bridge_pauses: bool,
) -> Plan:
    """Search each stretch of the query, or all of it at once; `soften` finds what stands beside a cheapest path."""
    nodes = np.full(len(query), -1, np.int64)
    mixtures: list[Mixture | None] = [None] * len(query)
    cost = 0.0
    for places in [np.arange(len(query))] if bridge_pauses else stretches(query.phones):
        asked = part(query, places)
        path = search(asked)
        nodes[places] = path.nodes
        cost += path.cost
        if soften is not None:
            mixtures[places[0] : places[-1] + 1] = soften(asked, path)
    return Plan(query, nodes, cost, None if soften is None else tuple(mixtures))


def stretches(phones: Ints) -> list[Ints]:
    """Positions of each run of phones that are not silence (-1)."""
    spoken = np.flatnonzero(phones >= 0)
    return [run for run in np.split(spoken, np.flatnonzero(np.diff(spoken) > 1) + 1) if len(run)]


def part(query: Query, places: Ints) -> Query:
    """The query at consecutive positions."""
    first = int(places[0])
    fixed = {t - first: node for t, node in query.fixed.items() if first <= t <= places[-1]}
    strict = None if query.strict is None else query.strict[places]
    heard = None if query.heard is None else query.heard[places]
    return Query(query.phones[places], query.visemes[places], query.emotions[places], fixed, strict, heard)
