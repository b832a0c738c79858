"""Tables of numbers as text: commas, semicolons or tabs, decimal points or commas, with or without names of columns."""

import csv
import io
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.encoding import text_of
from facesynth.inference.errors import FacesynthError

_COMMA_NUMBER = re.compile(r"\s*[-+]?\d+,\d+([eE][-+]?\d+)?\s*")
EXCEL = re.compile(r"sep=(.)", re.IGNORECASE)
"""A first line that says which sign parts the cells, as Excel writes and reads it."""
HEAD_BYTES = 1 << 20
"""Hold the rows that names are looked for in."""
_LONGEST_QUOTE = 60
_LOOKED_AT = 50
"""Rows that show how numbers are written."""
MISSING = frozenset({"", "nan", "-nan", "nan(ind)", "-nan(ind)", "1.#ind", "-1.#ind", "1.#qnan", "na", "n/a", "null", "none"})
"""Empty cells, and NaN as C's libraries write it."""


def read_cells(path: Path, separator: str = "", decimal: str = "") -> tuple[list[str], NDArray[np.float64]]:
    """Names of the columns (none where the first line holds numbers), and the numbers [T, columns]; NaN for empty cells."""
    rows = without_idle_ends(_rows(path, separator))
    width = len(rows[0]) if rows else 0
    for number, row in enumerate(rows, start=1):
        if len(row) != width:
            raise FacesynthError(f"{path}, line {number}: {len(row)} cells, but {width} columns")
    point = decimal or _decimal(rows)
    named = not rows or not all(is_number(cell, point) or cell.lower() in MISSING for cell in rows[0])
    columns, body = (rows[0] if rows else [], [row for row in rows[1:] if row != rows[0]]) if named else ([], rows)
    table = np.array([[_value(path, cell, point) for cell in row] for row in body], np.float64)
    return columns, table.reshape(len(body), width)


def read_names(path: Path, separator: str = "", decimal: str = "") -> list[str]:
    """Names of the columns alone; none where the first line holds numbers."""
    rows = _rows(path, separator, most=_LOOKED_AT)
    point = decimal or _decimal(rows)
    return [] if not rows or all(is_number(cell, point) for cell in rows[0]) else rows[0]


def is_number(text: str, decimal: str = ".") -> bool:
    """Whether a cell holds a number."""
    try:
        float(text.replace(decimal, "."))
    except ValueError:
        return False
    return True


def _rows(path: Path, separator: str, most: int | None = None) -> list[list[str]]:
    try:
        with io.StringIO(without_preamble(text_of(path, HEAD_BYTES if most is not None else None)), newline="") as file:
            first = file.readline()
            said = EXCEL.fullmatch(first.strip())
            sign = separator or (said[1] if said else separator_of(first))
            file.seek(len(first) if said else 0)
            reader = csv.reader(file, delimiter=sign, skipinitialspace=sign == " ")
            rows: list[list[str]] = []
            for row in reader:
                rows += [[cell.strip() for cell in row]] if row else []
                if most is not None and len(rows) >= most:
                    break
            return rows
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FacesynthError(f"{path} cannot be read as CSV ({error}); export it again") from None


def without_preamble(text: str) -> str:
    """The text of a table without empty lines before it and without NUL characters."""
    return re.sub(r"\A(?:[^\S\n]*\n)+", "", text.replace("\0", ""))


def without_idle_ends(rows: list[list[str]]) -> list[list[str]]:
    """Rows of a table without the empty cells that separators at the ends of its lines leave, also where names have none."""
    names, body = rows[:1], rows[1:]
    if not body or not names[0] or len({len(row) for row in body}) > 1 or any(row[-1] for row in body):
        return rows
    if len(body[0]) == len(names[0]) + 1:
        return [*names, *(row[:-1] for row in body)]
    if len(body[0]) == len(names[0]) > 1 and not names[0][-1]:
        return without_idle_ends([row[:-1] for row in rows])
    return rows


def separator_of(line: str) -> str:
    """The sign that occurs most; a comma may also be a decimal one, so it comes after semicolon and tab."""
    line = line.lstrip("\ufeff")
    return next((sign for sign in (";", "\t") if sign in line), ",")


def _decimal(rows: Sequence[Sequence[str]]) -> str:
    cells = [cell for row in rows[:_LOOKED_AT] for cell in row]
    return "," if any(_COMMA_NUMBER.fullmatch(cell) for cell in cells) else "."


def _value(path: Path, cell: str, decimal: str) -> float:
    if cell.lower() in MISSING:
        return np.nan
    try:
        return float(cell.replace(decimal, "."))
    except ValueError:
        shown = cell if len(cell) <= _LONGEST_QUOTE else f"{cell[:_LONGEST_QUOTE]}…"
        raise FacesynthError(
            f"{path}: could not convert {shown!r} to a number; wanted numbers below the names of the columns"
        ) from None
