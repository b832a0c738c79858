"""Arrays of long recordings, kept in a file without a name that is mapped: memory holds what is looked at, not the whole."""

import mmap
import tempfile
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Self

import numpy as np
from numpy.typing import DTypeLike, NDArray

LARGE_BYTES = 4 << 20
"""What is smaller stays in memory: 20 s of sound at 44.1 kHz."""
BLOCK_BYTES, BLOCK_ROWS = 4 << 20, 1024
"""Looked at together, at most; of arrays with more than one axis so many rows, of which something larger may be made."""


Change = Callable[[NDArray[Any]], NDArray[Any]]
"""Makes something of an array, or of a part of it."""


class Growing:
    """An array that is written part after part, along its first axis.

    It moves to a file as soon as it is large. The file has no name, takes room where the system keeps temporary files, and is
    gone with the array.
    """

    def __init__(self, dtype: DTypeLike = np.float32) -> None:
        self._dtype = np.dtype(dtype)
        self._parts: list[NDArray[Any]] = []
        self._file: Any = None
        self._bytes = 0
        self._beside: tuple[int, ...] = ()

    def add(self, part: NDArray[Any]) -> Self:
        """One more part, of the shape of those before beside the first axis."""
        values = np.ascontiguousarray(part, self._dtype)
        self._beside, self._bytes = values.shape[1:], self._bytes + values.nbytes
        if self._file is None and self._bytes > LARGE_BYTES:
            self._file = tempfile.TemporaryFile()  # noqa: SIM115 - closed by `whole`
            for earlier in self._parts:
                self._file.write(earlier.data)
            self._parts = []
        if self._file is None:
            self._parts.append(values.copy() if values.base is not None else values)
        elif values.nbytes:
            self._file.write(values.data)
        return self

    def whole(self) -> NDArray[Any]:
        """All parts, one after the other; nothing can be added any more."""
        if self._file is None:
            return np.concatenate(self._parts) if self._parts else np.zeros((0, *self._beside), self._dtype)
        self._file.flush()
        with self._file:
            pages = mmap.mmap(self._file.fileno(), self._bytes)
        return np.frombuffer(pages, self._dtype).reshape(-1, *self._beside)


def joined(parts: Iterable[NDArray[Any]], dtype: DTypeLike = np.float32) -> NDArray[Any]:
    """Parts of an array one after the other along the first axis, in a file where they are large together."""
    growing = Growing(dtype)
    for part in parts:
        growing.add(part)
    return growing.whole()


def zeros(shape: tuple[int, ...], dtype: DTypeLike = np.float64) -> NDArray[Any]:
    """Zeros to be written over, in a file where they are large."""
    size = int(np.prod(shape)) * np.dtype(dtype).itemsize
    if size <= LARGE_BYTES:
        return np.zeros(shape, dtype)
    with tempfile.TemporaryFile() as file:
        file.truncate(size)
        pages = mmap.mmap(file.fileno(), size)
    return np.frombuffer(pages, dtype).reshape(shape)


def row_blocks(values: NDArray[Any]) -> Iterator[slice]:
    """Stretches of the first axis that cover an array; what was seen of it leaves memory before the next one comes."""
    size = max(1, BLOCK_BYTES // max(1, values[:1].nbytes))
    size = min(size, BLOCK_ROWS) if values.ndim > 1 else size
    for first in range(0, len(values), size):
        yield slice(first, min(first + size, len(values)))
        let_go(values)


def by_blocks(change: Change, values: NDArray[Any], dtype: DTypeLike = np.float32) -> NDArray[Any]:
    """What a change of single rows makes of an array, done block by block."""
    return joined((change(values[rows]) for rows in row_blocks(values)), dtype)


def by_overlapping_blocks(change: Change, values: NDArray[Any], reach: int) -> NDArray[Any]:
    """The same of a change whose rows depend on so many rows before and after them as well, in double precision."""
    parts = Growing(np.float64)
    for rows in row_blocks(values):
        first = max(0, rows.start - reach)
        parts.add(change(values[first : rows.stop + reach])[rows.start - first : rows.stop - first])
    return parts.whole()


def by_columns(change: Change, values: NDArray[Any], count: int) -> NDArray[Any]:
    """What a change of single columns makes of an array [T, C]: [count, C], in double precision."""
    out = zeros((count, values.shape[1]))
    size = max(1, BLOCK_BYTES // max(1, max(len(values), count) * out.itemsize))
    for first in range(0, values.shape[1], size):
        out[:, first : first + size] = change(np.asarray(values[:, first : first + size], np.float64))
        let_go(values)
        let_go(out)
    return out


def copied(values: NDArray[Any]) -> NDArray[Any]:
    """A copy, in a file where it is large."""
    return by_blocks(np.asarray, values, values.dtype)


def all_finite(values: NDArray[Any]) -> bool:
    """Whether an array holds neither NaN nor infinity, without a copy of it."""
    return all(np.isfinite(values[rows]).all() for rows in row_blocks(values))


def loudest(values: NDArray[Any]) -> float:
    """Largest absolute value of an array, 0 of none, without a copy of it."""
    return max((float(np.abs(values[rows]).max()) for rows in row_blocks(values)), default=0.0)


def let_go(values: NDArray[Any]) -> None:
    """Let the pages of an array in a file leave memory: they are read again when they are looked at. Other arrays stay."""
    owner: Any = values
    while isinstance(owner, np.ndarray | memoryview):
        owner = owner.base if isinstance(owner, np.ndarray) else owner.obj
    if isinstance(owner, mmap.mmap) and hasattr(owner, "madvise"):
        owner.madvise(mmap.MADV_DONTNEED)
