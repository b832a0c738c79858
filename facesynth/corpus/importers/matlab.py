"""MATLAB files up to version 7.2, read by SciPy once their elements are known to fit: on damaged ones its reader may crash.

A file is a header of 128 bytes and elements, each a type, a size and that many bytes; arrays are elements that hold elements
(MATLAB's "MAT-File Format", level 5).
"""

import math
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from facesynth.inference.errors import FacesynthError
from facesynth.inference.npz import LARGEST_BYTES

HEADER = 128
ARRAY, COMPRESSED, NAMES, INTEGERS, FLAGS = 14, 15, 1, 5, 6
WIDTHS = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}
"""Bytes of a value, by type of element."""
CELL, STRUCT, OBJECT, TEXT, SPARSE, FIRST_NUMBERS, LAST_NUMBERS = 1, 2, 3, 4, 5, 6, 15
COMPLEX = 0x800
DEEPEST = 20
"""Arrays within arrays."""
Element = tuple[int, memoryview]
"""Type and bytes."""


def load_mat(path: Path) -> dict[str, Any]:
    """The variables of a MATLAB file (up to version 7.2), structs as objects; FacesynthError where it is damaged."""
    from scipy.io import loadmat

    try:
        _require_whole(path.read_bytes())
        return {name: value for name, value in loadmat(path, squeeze_me=False).items() if not name.startswith("__")}
    except NotImplementedError:
        raise FacesynthError(f"{path} is a MATLAB 7.3 file; save it with -v7") from None
    except Exception as error:  # SciPy's reader raises anything on damaged files
        raise FacesynthError(f"{path} is no MATLAB file, or is damaged ({' '.join(str(error).split())})") from None


def _require_whole(content: bytes) -> None:
    """ValueError where an element of a file of level 5 does not fit; older and newer files are left to SciPy."""
    order = {b"IM": "<", b"MI": ">"}.get(content[126:HEADER])
    if order is None or 0 in content[:4] or content[124:126] in (b"\x00\x02", b"\x02\x00"):
        return
    view, place = memoryview(content), HEADER
    while place < len(view):
        kind, inside, place = _outermost(view, place, order)
        if kind == COMPRESSED:
            plain = memoryview(zlib.decompressobj().decompress(inside, LARGEST_BYTES))
            kind, inside, _ = _outermost(plain, 0, order)
        if kind != ARRAY:
            raise ValueError(f"an element is of type {kind}, wanted {ARRAY}")
        _Elements(inside, order).array(0)


def _outermost(view: memoryview, place: int, order: str) -> tuple[int, memoryview, int]:
    """Type and bytes of the element that begins at a place, and where the next one begins."""
    if place + 8 > len(view):
        raise ValueError("it ends within an element")
    kind, size = struct.unpack_from(f"{order}II", view, place)
    inside = view[place + 8 : place + 8 + size]
    if len(inside) < size:
        raise ValueError(f"an element of {size} bytes is cut off")
    return kind, inside, place + 8 + size


class _Elements:
    """The elements of an array, one after the other."""

    def __init__(self, view: memoryview, order: str) -> None:
        self.view, self.order, self.place = view, order, 0

    def next(self) -> Element:
        """The next element; ones of up to four bytes stand in their own tag."""
        if self.place + 8 > len(self.view):
            raise ValueError("an array ends too early")
        kind, size = struct.unpack_from(f"{self.order}II", self.view, self.place)
        start, end = self.place + 8, self.place + 8 + -(-size // 8) * 8
        if kind >> 16:
            kind, size, start, end = kind & 0xFFFF, kind >> 16, self.place + 4, self.place + 8
        if start + size > len(self.view) or (start == self.place + 4 and size > 4):
            raise ValueError("an element does not fit into its array")
        self.place = end
        return kind, self.view[start : start + size]

    def integers(self) -> list[int]:
        """The numbers of an element of whole numbers."""
        kind, data = self.next()
        if kind != INTEGERS or len(data) % 4:
            raise ValueError("an array has no dimensions")
        return [int(number) for number in np.frombuffer(data, f"{self.order}i4")]

    def array(self, depth: int) -> None:
        """One array, whole; ValueError where its parts do not fit."""
        if not len(self.view):
            return
        if depth > DEEPEST:
            raise ValueError("arrays lie too deep in one another")
        kind, flags = self.next()
        if kind != FLAGS or len(flags) != 8:
            raise ValueError("an array has no flags")
        (word,) = struct.unpack_from(f"{self.order}I", flags)
        of = word & 0xFF
        if of > LAST_NUMBERS:  # functions and objects are not read as motion
            return
        sides = self.integers()
        if len(sides) < 2 or min(sides) < 0:
            raise ValueError("an array has dimensions that are none")
        count = math.prod(sides)
        if self.next()[0] != NAMES:
            raise ValueError("an array has no name")
        if of >= FIRST_NUMBERS or of == TEXT:
            self.values(count, exactly=of != TEXT)
            if of != TEXT and word & COMPLEX:
                self.values(count, exactly=True)
        elif of == SPARSE:
            self.sparse(sides, bool(word & COMPLEX))
        elif of in (CELL, STRUCT, OBJECT):
            self.arrays(of, count, depth)
        else:
            raise ValueError(f"an array is of kind {of}, which there is not")

    def values(self, count: int, *, exactly: bool) -> None:
        """So many numbers, or letters, of which some take several bytes."""
        kind, data = self.next()
        if kind not in WIDTHS or (exactly and len(data) != count * WIDTHS[kind]) or (not exactly and len(data) < count):
            raise ValueError(f"an array of {count} values holds {len(data)} bytes")

    def sparse(self, sides: list[int], is_complex: bool) -> None:
        """Rows, starts of columns, values."""
        rows, starts = self.integers(), self.integers()
        if len(starts) != sides[1] + 1 or starts[0] < 0 or starts != sorted(starts) or starts[-1] > len(rows):
            raise ValueError("a sparse array has columns that do not fit")
        if rows and not 0 <= min(rows) <= max(rows) < max(sides[0], 1):
            raise ValueError("a sparse array has rows that do not fit")
        for _ in range(1 + is_complex):
            kind, data = self.next()
            if kind not in WIDTHS or len(data) < starts[-1] * WIDTHS[kind]:
                raise ValueError("a sparse array lacks values")

    def arrays(self, of: int, count: int, depth: int) -> None:
        """The arrays of a cell array, or of all fields of structs."""
        if of == OBJECT:
            self.next()
        if of != CELL:
            (length,) = self.integers()
            kind, names = self.next()
            if kind != NAMES or length < 1 or len(names) % length:
                raise ValueError("a struct has fields without names")
            count *= len(names) // length
        if 8 * count > len(self.view):
            raise ValueError(f"{count} arrays do not fit into one")
        for _ in range(count):
            kind, data = self.next()
            if kind != ARRAY:
                raise ValueError("a struct holds what is no array")
            _Elements(data, self.order).array(depth + 1)
