"""Motion nodes: what was captured, one phone at a time, as a struct of arrays."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints

COLUMNS = ("starts", "stops", "phones", "visemes", "emotions", "before")
"""Of the table of nodes, in files too."""


@dataclass(frozen=True, eq=False)
class Nodes:
    """N nodes over frames of D coordinates; node n has the frames `frames[starts[n]:stops[n]]`."""

    frames: NDArray[np.floating[Any]]
    """[F, D] PCA coordinates at the database's rate."""
    starts: Ints
    stops: Ints
    phones: Ints
    """[N] index of the phone."""
    visemes: Ints
    """[N] index of the viseme class."""
    emotions: Ints
    """[N] index of the emotion."""
    before: Ints
    """[N] the node recorded just before in the same sub-sentence (`pre`), or -1."""

    def __len__(self) -> int:
        return len(self.starts)

    @cached_property
    def lengths(self) -> Ints:
        """[N] frames of each node."""
        return self.stops - self.starts

    @cached_property
    def after(self) -> Ints:
        """[N] the node recorded just after (`suc`), or -1."""
        after = np.full(len(self), -1, np.int64)
        followers = np.flatnonzero(self.before >= 0)
        after[self.before[followers]] = followers
        return after

    def motion(self, node: int) -> Floats:
        """[L, D] frames of one node."""
        return self.frames[self.starts[node] : self.stops[node]].astype(np.float64)

    def take(self, chosen: Ints) -> Self:
        """The nodes `chosen` in this order; a neighbour that is left out becomes -1."""
        place = np.full(len(self) + 1, -1, np.int64)
        place[chosen] = np.arange(len(chosen))
        columns = {name: getattr(self, name)[chosen] for name in COLUMNS}
        return replace(self, **{**columns, "before": place[columns["before"]]})

    @classmethod
    def from_pieces(cls, pieces: Sequence[Floats], phones: Ints, visemes: Ints, emotions: Ints, before: Ints) -> Self:
        """Nodes from their motions [L, D]."""
        stops = np.cumsum([len(piece) for piece in pieces])
        starts = np.concatenate([[0], stops[:-1]]).astype(np.int64)
        return cls(np.concatenate(pieces).astype(np.float64), starts, stops, phones, visemes, emotions, before)
