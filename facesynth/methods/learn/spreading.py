"""Who does what consists of independent pieces while a method learns: this process, several, or a Ray cluster.

A method does not ask for workers: `fit` is the same for all of them. What it hands to `in_pieces` is spread over those of the
`working` block that it runs in, with the same results in the same order, so what is learned does not depend on them.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import TypeVar

from facesynth.corpus.workers import ALONE, Workers, spread

Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass
class Team:
    """Who works in a block, and what came of it."""

    workers: Workers
    pieces: int = 0
    """How many they were given."""


_TEAM: ContextVar[Team | None] = ContextVar("team", default=None)


@contextmanager
def working(workers: Workers) -> Iterator[Team]:
    """Let what is learned in this block be spread over these workers."""
    team = Team(workers)
    before = _TEAM.set(team)
    try:
        yield team
    finally:
        _TEAM.reset(before)


def in_pieces(function: Callable[[Item], Result], items: Sequence[Item], what: str) -> Iterator[Result]:
    """`map(function, items)` in order, by whoever works in this block; function and items go to other processes."""
    team = _TEAM.get() or Team(ALONE)
    team.pieces += len(items)
    return spread(function, items, team.workers, what)
