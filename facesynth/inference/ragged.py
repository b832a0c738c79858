"""Arrays of many lengths that lie one after the other in a long one: what is known of the candidates of each phone."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, Generic, Self, TypeVar, overload

import numpy as np
from numpy.typing import DTypeLike, NDArray

from .long_arrays import Growing, let_go

LOOKED_AT = 256
"""Arrays after which what was looked at leaves memory."""
T = TypeVar("T")


class Made(Sequence[T], Generic[T]):
    """A sequence whose items are made when they are looked at, and not kept."""

    def __init__(self, make: Callable[[int], T], count: int) -> None:
        self._make, self._count = make, count

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, index: int) -> T: ...
    @overload
    def __getitem__(self, index: slice) -> list[T]: ...
    def __getitem__(self, index: int | slice) -> T | list[T]:
        """One, or those of a slice as a list."""
        if isinstance(index, slice):
            return [self._make(t) for t in range(*index.indices(self._count))]
        return self._make(range(self._count)[index])

    def __iter__(self) -> Iterator[T]:
        return (self._make(t) for t in range(self._count))


class Ragged(Made[NDArray[Any]]):
    """T arrays [n_t], added one by one and looked at by their number: in a file where they are large together.

    Nothing can be added after the first look.
    """

    def __init__(self, dtype: DTypeLike = np.float64, parts: Iterable[NDArray[Any]] = ()) -> None:
        super().__init__(self._part, 0)
        self._growing, self._ends, self._looked = Growing(dtype), [0], 0
        self._values: NDArray[Any] | None = None
        for part in parts:
            self.add(part)

    def add(self, part: NDArray[Any]) -> Self:
        """One more."""
        self._growing.add(part)
        self._ends.append(self._ends[-1] + len(part))
        self._count += 1
        return self

    def _part(self, t: int) -> NDArray[Any]:
        if self._values is None:
            self._values = self._growing.whole()
        self._looked += 1
        if self._looked % LOOKED_AT == 0:
            let_go(self._values)
        return self._values[self._ends[t] : self._ends[t + 1]]
