"""The anime graph: one node per recorded phone, an edge from each to the one recorded after it (Cao 2005, §4.1)."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..phones import VISEMES

VISEME_OF = np.array(VISEMES)


@dataclass(frozen=True, eq=False)
class Graph:
    """N nodes as a struct of arrays. Node n moves through `frames[starts[n]:stops[n]]` (eq. 1: P, C, M, E)."""

    frames: Floats
    """[F, D] components of all runs, one after the other; a run is a stretch of linked nodes."""
    features: Floats
    """[G, P] audio features of the same."""
    phones: Ints
    """[N] index into PHONES."""
    emotions: Ints
    """[N] index into the corpus' emotions."""
    starts: Ints
    stops: Ints
    feature_starts: Ints
    feature_stops: Ints
    run_starts: Ints
    """[N] first frame of the run that the node belongs to."""
    run_stops: Ints
    """[N] one past the run's last frame."""
    before: Ints
    """[N] the node recorded just before, or -1."""
    after: Ints
    """[N] the node recorded just after, or -1."""
    utterances: Ints
    """[N] which utterance the node was recorded in."""
    numbers: Ints
    """[N] which of its phones it is."""

    @classmethod
    def of(cls, arrays: Mapping[str, NDArray[Any]]) -> Self:
        """From arrays as they are stored: single precision, or few bits with a `NAME_scale` beside them."""
        columns: dict[str, Any] = {f.name: arrays[f.name].astype(np.int64) for f in fields(cls)[2:]}
        for name in ("frames", "features"):
            scale = arrays[f"{name}_scale"].astype(np.float64) if f"{name}_scale" in arrays else 1.0
            columns[name] = arrays[name].astype(np.float64) * scale
        return cls(**columns)

    def __len__(self) -> int:
        return len(self.starts)

    @property
    def lengths(self) -> Ints:
        """[N] frames of each node."""
        return self.stops - self.starts

    def motion(self, node: int) -> Floats:
        """[L, D] what the node captured."""
        return self.frames[self.starts[node] : self.stops[node]]

    def audio(self, node: int) -> Floats:
        """[L', P] what the node sounded like."""
        return self.features[self.feature_starts[node] : self.feature_stops[node]]

    def following(self, node: int, count: int) -> Floats:
        """[up to count, D] the frames recorded after the node."""
        stop = self.stops[node]
        return self.frames[stop : min(stop + count, self.run_stops[node])]

    def preceding(self, node: int, count: int) -> Floats:
        """[up to count, D] the frames recorded before the node."""
        start = self.starts[node]
        return self.frames[max(start - count, self.run_starts[node]) : start]

    def of_phone(self, phone: int) -> Ints:
        """Nodes of a phone."""
        return np.flatnonzero(self.phones == phone)

    def of_viseme(self, phone: int) -> Ints:
        """Nodes of the phones that look like this one."""
        return np.flatnonzero(VISEME_OF[self.phones] == VISEME_OF[phone])
