"""Motion nodes: what was captured, one phone at a time, as a struct of arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MotionNodes:
    """N nodes over frames of D coordinates; node n has the frames `frames[starts[n]:stops[n]]`."""

    frames: Floats
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
    after: Ints
    """[N] the node recorded just after (`suc`), or -1."""

    def __len__(self) -> int:
        return len(self.starts)

    @property
    def lengths(self) -> Ints:
        """[N] frames of each node."""
        return self.stops - self.starts

    def motion(self, node: int) -> Floats:
        """[L, D] frames of one node."""
        return self.frames[self.starts[node] : self.stops[node]]

    def take(self, keep: NDArray[Any]) -> Self:
        """The nodes `keep` (sorted indices); a neighbour that is left out becomes -1."""
        place = np.full(len(self) + 1, -1, np.int64)
        place[keep] = np.arange(len(keep))
        changes = {f.name: getattr(self, f.name)[keep] for f in fields(self) if f.name != "frames"}
        changes["before"], changes["after"] = place[changes["before"]], place[changes["after"]]
        return replace(self, **changes)

    @classmethod
    def from_pieces(cls, pieces: Sequence[Floats], phones: Ints, visemes: Ints, emotions: Ints, before: Ints) -> Self:
        """Nodes from their motions [L, D]; `after` follows from `before`."""
        stops = np.cumsum([len(piece) for piece in pieces])
        starts = np.concatenate([[0], stops[:-1]]).astype(np.int64)
        after = np.full(len(pieces), -1, np.int64)
        has = before >= 0
        after[before[has]] = np.flatnonzero(has)
        return cls(np.concatenate(pieces).astype(np.float64), starts, stops, phones, visemes, emotions, before, after)
