"""What an editor keeps between one change and the next, so that only what changed is computed again.

Everything here gives what it would give anew: paths to the node, costs to the rounding of matrix products.
"""

from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field, fields
from typing import Generic, Self, TypeVar

import numpy as np

from ..arrays import Floats, Ints
from ..efase.costs import Query, Weights
from ..efase.hearing import Heard, Hearing
from ..efase.nodes import Nodes
from ..efase.search import Search, SearchIndex
from ..efase.steps import step_matrix
from ..expectation import Single
from ..long_arrays import row_blocks
from ..speech import Speech

SEARCHES_BYTES = 1 << 28
"""Memory of the searches that are kept; the newest is kept in any case."""
POSITION_BYTES = 20
"""Of one node at one phone of a search."""
STRETCHES = 512
"""Results of stretches that are kept: a paragraph is edited sentence by sentence."""
ROWS = 256
"""Phones whose costs at all nodes are kept."""
MATRICES = 1024
"""Matrices of steps between the candidates of two phones that are kept."""
HEARD = 4
"""Whole inputs of which is kept what was heard."""

Value = TypeVar("Value")


class Memory(Generic[Value]):
    """Values by what they were made from; those asked for longest ago are forgotten."""

    def __init__(self, most: int) -> None:
        self.most = most
        self._values: OrderedDict[Hashable, Value] = OrderedDict()

    def get(self, key: Hashable) -> Value | None:
        """The value, or None."""
        if key not in self._values:
            return None
        self._values.move_to_end(key)
        return self._values[key]

    def keep(self, key: Hashable, value: Value) -> Value:
        """Remember a value, and return it."""
        self._values[key] = value
        while len(self._values) > self.most:
            self._values.popitem(last=False)
        return value

    def of(self, key: Hashable, make: Callable[[], Value]) -> Value:
        """The value kept under a key, or a new one."""
        found = self.get(key)
        return self.keep(key, make()) if found is None else found


class KeptSearches:
    """An `Engine` that goes on from the kept search whose first phones ask for the same: those need not be searched again."""

    def __init__(self, index: SearchIndex) -> None:
        self.index = index
        self.phones_searched = 0
        """Of all inputs so far."""
        self._kept: list[tuple[Floats, Search]] = []

    def __call__(self, targets: Floats) -> Ints:
        """[T] the nodes of the path of least COST, by target costs [T, N]."""
        shared = self._shared(targets)
        best = int(np.argmax(shared)) if shared else -1
        search = self._kept[best][1].begun(shared[best]) if shared else Search(self.index)
        for target in targets[len(search) :]:
            search.push(target)
            self.phones_searched += 1
        path = search.path()
        self._keep(targets, search, shared)
        return path

    def _shared(self, targets: Floats) -> list[int]:
        """How many first rows each kept search has in common with these; a row that several searches share is compared once."""
        equal: dict[int, bool] = {}
        found = []
        for known, search in self._kept:
            count = 0
            for row, other, position in zip(targets, known, search.positions, strict=False):
                if id(position) not in equal:
                    equal[id(position)] = np.array_equal(row, other)
                if not equal[id(position)]:
                    break
                count += 1
            found.append(count)
        return found

    def _keep(self, targets: Floats, search: Search, shared: Sequence[int]) -> None:
        """As the newest; of the others as many as fit into the memory. What they share is counted for each."""
        most = SEARCHES_BYTES // (POSITION_BYTES * targets.shape[1])
        others = [one for one, count in zip(self._kept, shared, strict=True) if len(one[1]) > count]
        self._kept = [(targets, search)]
        for known, kept in others:
            most -= len(kept)
            if most < len(search):
                break
            self._kept.append((known, kept))


class KeptMatrices:
    """`step_matrix` of one database, with what it gave for pairs of phones whose candidates stayed."""

    def __init__(self) -> None:
        self._matrices: Memory[Floats] = Memory(MATRICES)

    def __call__(self, nodes: Nodes, before: Ints, after: Ints, weights: Weights) -> Floats:
        """See `step_matrix`."""
        key = (before.tobytes(), after.tobytes())
        return self._matrices.of(key, lambda: step_matrix(nodes, before, after, weights))


@dataclass(frozen=True, eq=False)
class KeptHearing(Hearing):
    """A `Hearing` that hears a sound once, and a phone again only where what is heard or expected there changed."""

    _bands: Memory[Single] = field(default_factory=lambda: Memory(1))
    _heard: Memory[Heard] = field(default_factory=lambda: Memory(HEARD))
    _rows: Memory[Floats] = field(default_factory=lambda: Memory(ROWS))

    @classmethod
    def of(cls, hearing: Hearing) -> Self:
        """The same, remembering."""
        return cls(**{part.name: getattr(hearing, part.name) for part in fields(Hearing)})

    def hear(self, speech: Speech, felt: Ints, count: int, fps: float) -> Heard:
        """See `Hearing.hear`."""
        track = speech.phones
        key = (_sound_key(speech), track.labels, track.ends_s.tobytes(), felt.tobytes(), count, fps)
        return self._heard.of(key, lambda: super(KeptHearing, self).hear(speech, felt, count, fps))

    def heard_bands(self, speech: Speech) -> Single:
        """See `Hearing.heard_bands`."""
        return self._bands.of(_sound_key(speech), lambda: super(KeptHearing, self).heard_bands(speech))

    def rows(self, what: str, compute: Callable[[Sequence[Floats]], Floats], asked: Sequence[Floats]) -> Floats:
        """See `Hearing.rows`."""
        if not len(asked):
            return compute(asked)
        keys = [(what, piece.shape, piece.tobytes()) for piece in asked]
        found = {key: row for key in keys if (row := self._rows.get(key)) is not None}
        new = [place for place, key in enumerate(keys) if key not in found]
        if new:
            computed = compute([asked[place] for place in new])
            found |= {keys[place]: self._rows.keep(keys[place], row) for place, row in zip(new, computed, strict=True)}
        return np.stack([found[key] for key in keys])


def _sound_key(speech: Speech) -> Hashable:
    return (speech.sample_rate, len(speech.audio), *(hash(speech.audio[rows].tobytes()) for rows in row_blocks(speech.audio)))


def query_key(query: Query) -> Hashable:
    """What a stretch asks for, to be remembered by."""
    columns = tuple(column.tobytes() for column in (query.phones, query.visemes, query.emotions))
    strict = None if query.strict is None else query.strict.tobytes()
    heard = None if query.heard is None else hash(query.heard.tobytes())
    return (*columns, strict, heard, tuple(sorted(query.fixed.items())))
