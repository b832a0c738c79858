"""TextGrids as Praat reads them: long and short, chronological, binary and JSON, in any encoding that Praat has written.

A text file of Praat is a row of values: numbers that stand free, texts in double quotes (a quote inside is doubled) and
flags in angle brackets. Everything else, such as `xmin =` and `intervals [3]:`, is decoration, and `!` begins a remark.
"""

import json
import math
import re
import struct
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from facesynth.encoding import decoded
from facesynth.inference.errors import FacesynthError
from facesynth.speech.phone_labels import praat_signs
from facesynth.speech.segments import Segment

LARGEST_BYTES = 2**28
_TOKEN = re.compile(r'"((?:[^"]|"")*)"|![^\n]*|(?<!\S)<(\w+)>(?!\S)|(?<!\S)([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)(?!\S)')
_BINARY = b"ooBinaryFile"
_MOST_TIERS, _MOST_THINGS = 10_000, 10**9


@dataclass(frozen=True)
class Tier:
    """A row of labelled intervals, or of points in time."""

    name: str
    intervals: tuple[Segment, ...]
    """Label, start and end in seconds, as they stand in the file; of a tier of points none."""
    of_points: bool = False


@dataclass(frozen=True)
class Grid:
    """What a TextGrid holds."""

    start_s: float
    end_s: float
    tiers: tuple[Tier, ...]
    encoding: str = ""
    """In which the text was written, where it had to be guessed."""


def read_grid(path: Path) -> Grid:
    """The tiers of a TextGrid; FacesynthError for what is none, or breaks off."""
    if not path.is_file():
        raise FacesynthError(f"{path}: no such TextGrid")
    if path.stat().st_size > LARGEST_BYTES:
        raise FacesynthError(f"{path} is not a TextGrid: it is larger than {LARGEST_BYTES >> 20} MB")
    content = path.read_bytes()
    try:
        if content.startswith(_BINARY):
            return _checked(_Binary(content).grid())
        text, encoding = decoded(content)
        grid = _from_json(text) if text.lstrip().startswith("{") else _Text(text).grid()
        return _checked(Grid(grid.start_s, grid.end_s, grid.tiers, encoding))
    except (_BrokenError, ValueError, KeyError, TypeError, AttributeError, OverflowError, struct.error, RecursionError) as error:
        raise FacesynthError(f"{path} is not a TextGrid that Praat would read ({' '.join(str(error).split())[:160]})") from None


class _BrokenError(Exception):
    """What is wrong with a file."""


class _Text:
    """The values of a text file, one after the other."""

    def __init__(self, text: str) -> None:
        self._values = self._tokens(text.replace("\r\n", "\n").replace("\r", "\n"))

    @staticmethod
    def _tokens(text: str) -> Iterator[str | float | bool]:
        for match in _TOKEN.finditer(text):
            string, flag, number = match.groups()
            if string is not None:
                yield string.replace('""', '"')
            elif flag is not None:
                yield flag == "exists"
            elif number is not None:
                yield float(number)

    def grid(self) -> Grid:
        head = self.text()
        if head.startswith("Praat chronological"):
            return self._chronological()
        if "ooTextFile" not in head or self.text() != "TextGrid":
            raise _BrokenError("its first lines do not say that it is one")
        start_s, end_s = self.number(), self.number()
        if not self._next(bool, "whether there are tiers"):
            return Grid(start_s, end_s, ())
        return Grid(start_s, end_s, tuple(_tier(self) for _ in range(self.count())))

    def _chronological(self) -> Grid:
        start_s, end_s = self.number(), self.number()
        heads = []
        for _ in range(self.count()):
            kind, name, *_ = self.text(), self.text(), self.number(), self.number()
            heads.append((kind, name))
        found: list[list[Segment]] = [[] for _ in heads]
        for value in self._values:
            number = int(value) - 1 if isinstance(value, float) else -1
            if not 0 <= number < len(heads):
                raise _BrokenError(f"{value!r} is the number of no tier")
            if heads[number][0] == "IntervalTier":
                begin_s, stop_s, label = self.number(), self.number(), self.text()
                found[number].append((in_letters(label), begin_s, stop_s))
            else:
                self.number(), self.text()
        tiers = (Tier(name, tuple(segments), kind != "IntervalTier") for (kind, name), segments in zip(heads, found, strict=True))
        return Grid(start_s, end_s, tuple(tiers))

    def text(self) -> str:
        return str(self._next(str, "a text in quotes"))

    def number(self) -> float:
        return float(self._next(float, "a number"))

    def count(self) -> int:
        return _whole(self.number())

    def _next(self, kind: type, what: str) -> Any:
        value = next(self._values, None)
        if value is None:
            raise _BrokenError(f"it breaks off where {what} should follow")
        if type(value) is not kind:
            raise _BrokenError(f"{value!r} stands where {what} should")
        return value


class _Binary:
    """The values of a binary file of Praat: big-endian, texts behind their length."""

    def __init__(self, content: bytes) -> None:
        self._content, self._at = content, len(_BINARY)

    def grid(self) -> Grid:
        if self._short_text() != "TextGrid":
            raise _BrokenError("its first bytes do not say that it is one")
        start_s, end_s = self.number(), self.number()
        if not self._value(">b"):
            return Grid(start_s, end_s, ())
        return Grid(start_s, end_s, tuple(_tier(self, self._short_text) for _ in range(self.count())))

    def number(self) -> float:
        return float(self._value(">d"))

    def count(self) -> int:
        return _whole(self._value(">i"))

    def text(self) -> str:
        length = self._value(">h")
        return self._bytes(2 * self._value(">h")).decode("utf-16-be") if length == -1 else self._bytes(length).decode("latin-1")

    def _short_text(self) -> str:
        return self._bytes(self._value(">B")).decode("latin-1")

    def _value(self, form: str) -> Any:
        return struct.unpack(form, self._bytes(struct.calcsize(form)))[0]

    def _bytes(self, count: int) -> bytes:
        part = self._content[self._at : self._at + count]
        if count < 0 or len(part) < count:
            raise _BrokenError("it breaks off")
        self._at += count
        return part


def _tier(values: _Text | _Binary, kind_of: Callable[[], str] | None = None) -> Tier:
    """The next tier of a file."""
    kind, name = (kind_of or values.text)(), values.text()
    values.number(), values.number()
    count = values.count()
    if kind.startswith("IntervalTier"):
        intervals = []
        for _ in range(count):
            start_s, end_s, label = values.number(), values.number(), values.text()
            intervals.append((in_letters(label), start_s, end_s))
        return Tier(name, tuple(intervals))
    if not kind.startswith("TextTier"):
        raise _BrokenError(f"it has a tier of the unknown class {kind[:40]!r}")
    for _ in range(count):
        values.number(), values.text()
    return Tier(name, (), of_points=True)


def in_letters(label: str) -> str:
    r"""A label with Praat's backslash signs for phonetic letters as those letters: `\sw` is ə, `\:f` a length mark."""
    if "\\" not in label:
        return label
    label = label.replace("\\:f", "ː")
    return re.sub(r"\\(..)", lambda match: praat_signs().get(match[1], match[0]), label)


# Two forms are in use: tiers as a list with their names inside, and tiers by name.
def _from_json(text: str) -> Grid:
    plain = json.loads(text)
    tiers = plain["tiers"]
    if isinstance(tiers, dict):
        tiers = [{"name": name, "class": tier.get("type", "interval"), **tier} for name, tier in tiers.items()]
    start_s, end_s = (plain.get(new, plain.get(old)) for new, old in (("xmin", "start"), ("xmax", "end")))
    return Grid(float(start_s), float(end_s), tuple(_json_tier(tier) for tier in tiers))


def _json_tier(tier: dict[str, Any]) -> Tier:
    if str(tier.get("class", "")).lower() not in ("interval", "intervaltier"):
        return Tier(str(tier["name"]), (), of_points=True)
    entries: Sequence[Sequence[Any]] = tier["entries"]
    return Tier(str(tier["name"]), tuple((str(label), float(start_s), float(end_s)) for start_s, end_s, label in entries))


def _whole(value: float) -> int:
    if not (0 <= value < _MOST_THINGS and value == int(value)):
        raise _BrokenError(f"{value:g} is no number of things")
    return int(value)


def _checked(grid: Grid) -> Grid:
    times = [grid.start_s, grid.end_s, *(time_s for tier in grid.tiers for segment in tier.intervals for time_s in segment[1:])]
    if not all(map(math.isfinite, times)):
        raise _BrokenError("it holds times that are not finite")
    if not grid.end_s > grid.start_s:
        raise _BrokenError(f"it ends at {grid.end_s:g} s, before it begins at {grid.start_s:g} s")
    if len(grid.tiers) > _MOST_TIERS:
        raise _BrokenError(f"it has {len(grid.tiers)} tiers")
    return grid
