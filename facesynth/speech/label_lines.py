"""Phones in lines of text: `end label`, HTK's and TIMIT's labels, master label files, xwaves, tables with a header."""

import csv
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from facesynth.encoding import decoded
from facesynth.inference.errors import FacesynthError
from facesynth.speech.segments import TOUCHING_S, Segment

FAR_BEYOND = 50
"""Whole numbers that go so many times beyond the sound's end are no seconds."""
UNITS_S: Mapping[str, float] = {
    **{"units of 100 ns, as HTK counts": 1e-7, "milliseconds": 1e-3},
    **{f"samples at {rate} Hz, as TIMIT counts": 1 / rate for rate in (8000, 11025, 16000, 22050, 24000, 32000, 44100, 48000)},
}
NUMBER = re.compile(r"[-+]?\d*\.?\d+(e[-+]?\d+)?", re.IGNORECASE)
_DECIMAL_COMMA = re.compile(r"(?<!\S)([-+]?\d*),(\d+)(?!\S)")
_HEADERS = {
    **dict.fromkeys(
        ("begin", "start", "start_s", "begin_s", "tmin", "xmin", "start_time", "begin_time", "onset", "from"), "start"
    ),
    **dict.fromkeys(("end", "end_s", "stop", "tmax", "xmax", "end_time", "stop_time"), "end"),
    **dict.fromkeys(("label", "phone", "phoneme", "text", "segment", "name", "value", "ipa"), "label"),
    **dict.fromkeys(("type", "tier"), "kind"),
}
"""Names of columns of tables of phones, in small letters."""


def line_segments(path: Path) -> tuple[list[Segment], tuple[str, ...]]:
    """The segments of a file of lines, and what was assumed of it; FacesynthError, naming the line, where one cannot be read."""
    if not path.is_file():
        raise FacesynthError(f"{path}: no such file of phones")
    try:
        text, encoding = decoded(path.read_bytes())
    except UnicodeDecodeError:
        raise FacesynthError(f"{path} is not text in UTF-8; expected lines of `end label`") from None
    told = (f"it is not UTF-8; it was read as {encoding}",) if encoding else ()
    table = _of_table(text)
    if table is not None:
        return table, told
    segments: list[Segment] = []
    lines = list(_lines(path, text))
    with_starts = any(len(line.split()) > 2 for _, line in lines)
    for number, line in lines:
        before_s = segments[-1][2] if segments else 0.0
        try:
            *times, label = _cells(line, with_starts)
            start_s, end_s = (before_s, *map(float, times))[-2:]
            if len(times) not in (1, 2) or not end_s >= max(start_s, before_s - TOUCHING_S):
                raise ValueError
        except ValueError:
            raise FacesynthError(
                f"{path}, line {number}: {line!r} is not `end label` or `start end label`"
                f" with times that go on from {before_s:g} s"
            ) from None
        segments.append((label, start_s, end_s))
    return segments, told


def in_seconds(segments: Sequence[Segment], duration_s: float | None) -> tuple[list[Segment], tuple[str, ...]]:
    """Segments whose times are whole numbers far beyond the sound's end in the unit that fits it best, and what is said of it."""
    last = segments[-1][2] if segments else 0.0
    whole = all(time == int(time) for _, *times in segments for time in times)
    if duration_s is None or not whole or last < FAR_BEYOND * duration_s:
        return list(segments), ()
    first = segments[0][1]
    length = last - first if first > last / 2 else last  # what begins so late was cut out of a longer file
    unit = min(UNITS_S, key=lambda name: abs(np.log(max(length * UNITS_S[name], 1e-12) / duration_s)))
    seconds = [(label, start * UNITS_S[unit], end * UNITS_S[unit]) for label, start, end in segments]
    return seconds, (f"its times go up to {last:.0f}: they were taken as {unit}",)


def _of_table(text: str) -> list[Segment] | None:
    """The segments of a table whose first line names its columns, those of phones where it says so; None for other lines."""
    rows = [line for line in text.splitlines() if line.strip()]
    sign = next((sign for sign in "\t;," if rows and sign in rows[0]), None)
    table = [[cell.strip() for cell in row] for row in csv.reader(rows, delimiter=sign or " ", skipinitialspace=True)]
    names = [_HEADERS.get(name.lower()) for name in table[0]] if table else []
    if "end" not in names or "label" not in names:
        return None
    places = {name: names.index(name) for name in ("start", "end", "label", "kind") if name in names}
    kept = [row for row in table[1:] if len(row) == len(names)]
    if "kind" in places and any("phone" in row[places["kind"]].lower() for row in kept):
        kept = [row for row in kept if "phone" in row[places["kind"]].lower()]
    try:
        ends_s = [_seconds(row[places["end"]]) for row in kept]
        starts_s = [_seconds(row[places["start"]]) for row in kept] if "start" in places else [0.0, *ends_s[:-1]]
    except ValueError:
        return None
    return [(row[places["label"]], *times) for row, *times in zip(kept, starts_s, ends_s, strict=True)]  # type: ignore[misc]


def _seconds(cell: str) -> float:
    return float(_DECIMAL_COMMA.sub(r"\1.\2", cell))


def _cells(line: str, with_starts: bool) -> list[str]:
    """Times and label of a line: without what HTK writes after a label, how likely it was; empty where a label is missing."""
    cells = line.split()
    if with_starts and len(cells) == 2 and all(map(NUMBER.fullmatch, cells)):
        return [*cells, ""]
    return cells[:3] if len(cells) == 4 and NUMBER.fullmatch(cells[3]) and not NUMBER.fullmatch(cells[2]) else cells


def _lines(path: Path, text: str) -> Iterable[tuple[int, str]]:
    """Number and text of each line that says something: of xwaves (header, `#`, `end colour label`) end and label, of a master
    label file those of the sound of this name, or of its only one.
    """
    stripped = [(number, _DECIMAL_COMMA.sub(r"\1.\2", line.strip())) for number, line in enumerate(text.splitlines(), start=1)]
    if text.lstrip("\ufeff").startswith("#!MLF!#"):
        return _of_master(path, stripped[1:])
    head = next((k for k, (_, line) in enumerate(stripped) if line == "#"), -1)
    said = [(number, line) for number, line in stripped[head + 1 :] if line and not line.startswith("#")]
    if head < 0 or not any(NUMBER.fullmatch(line.split()[1]) for _, line in said if len(line.split()) == 3):
        return said
    return [(number, f"{line.split()[0]} {line.split()[-1]}") for number, line in said]


def _of_master(path: Path, lines: Iterable[tuple[int, str]]) -> list[tuple[int, str]]:
    parts: dict[str, list[tuple[int, str]]] = {}
    name = ""
    for number, line in lines:
        if line.startswith('"'):
            name = Path(line.strip('"').replace("\\", "/")).stem
            parts[name] = []
        elif line and line != ".":
            parts.setdefault(name, []).append((number, " ".join(line.split()[:3])))
    if len(parts) > 1 and path.stem not in parts:
        raise FacesynthError(
            f"{path} holds the labels of {len(parts)} sounds, none of which is called {path.stem}; give one of each"
        )
    return parts[path.stem] if path.stem in parts else next(iter(parts.values()), [])
