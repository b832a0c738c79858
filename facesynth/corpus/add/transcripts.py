"""What is said in many recordings, in one table."""

import csv
import io
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from facesynth.corpus.record import COLUMNS, read_listed
from facesynth.encoding import encoding_remark, text_of
from facesynth.inference.errors import FacesynthError
from facesynth.motion.cells import separator_of

_NAMES = ("id", "file", "name")


LONGEST_LINE = 4096
MOST_NAMED = 5


@dataclass(frozen=True)
class Tables:
    """What the tables in a folder of recordings say."""

    texts: Mapping[str, str]
    """What is said, by name of the recording."""
    refused: Mapping[str, str] = field(default_factory=dict)
    """Why a table was not used, by its name."""
    used: Mapping[str, Collection[str]] = field(default_factory=dict)
    """Names of the recordings in each table that was."""
    guessed: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """What is said of the encoding of each of those."""

    def remarks(self, recordings: Collection[str]) -> dict[str, tuple[str, ...]]:
        """What each used table was good for, and what it names that is not there."""
        said = {}
        for table, names in self.used.items():
            absent = sorted(set(names) - set(recordings))
            some = ", ".join(absent[:MOST_NAMED]) + (" …" if len(absent) > MOST_NAMED else "")
            more = (f"names {len(absent)} that are not here: {some}",) if absent else ()
            said[table] = (f"says what is said in {len(names) - len(absent)} recordings", *more, *self.guessed.get(table, ()))
        return said


def is_table(path: Path) -> bool:
    """Whether a CSV says what is said in recordings, or lists them as utterances.csv does: it is no motion."""
    if path.suffix.lower() != ".csv":
        return False
    try:
        header = _columns(path)
    except (OSError, UnicodeDecodeError, csv.Error):
        return False
    return ("text" in header and any(name in header for name in _NAMES)) or ("id" in header and set(header) <= set(COLUMNS))


def read_tables(paths: Iterable[Path], texts: Mapping[str, str] | None, listed: Mapping[str, Mapping[str, Any]] | None) -> Tables:
    """What tables say of recordings; where `texts` or `listed` were given otherwise, those go before them."""
    found: dict[str, str] = {}
    refused: dict[str, str] = {}
    used: dict[str, Collection[str]] = {}
    guessed: dict[str, tuple[str, ...]] = {}
    for path in paths:
        try:
            if "text" not in _columns(path):
                if listed is None or read_listed(path) != listed:
                    refused[path.name] = "a list of recordings without their words; give it with --list if it is to be used"
                continue
            own = read_transcripts(path)
        except FacesynthError as error:
            refused[path.name] = str(error)
            continue
        if texts is None and listed is None:
            found |= own
            used[path.name] = tuple(own)
            guessed[path.name] = encoding_remark(path)
        elif own != texts and (listed is None or not set(own) <= set(listed)):
            refused[path.name] = "a table of what is said; the words came with --text-file or --list instead"
    return Tables({**found, **(texts or {})}, refused, used, guessed)


def read_transcripts(path: str | Path) -> dict[str, str]:
    """Texts by recording from a CSV with the columns `id` (or `file`) and `text`; a file's suffix is left out."""
    path = Path(path)
    try:
        rows = _cells(text_of(path))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FacesynthError(f"{path} cannot be read as CSV ({error})") from None
    header = _header(rows[0]) if rows else []
    name = next((column for column in _NAMES if column in header), None)
    if name is None or "text" not in header:
        raise FacesynthError(f"{path} needs the columns id and text in its first line; got {', '.join(header) or 'nothing'}")
    texts: dict[str, str] = {}
    for number, row in enumerate(rows[1:], start=2):
        if row and len(row) != len(header):
            raise FacesynthError(f"{path}, line {number}: {len(row)} cells, but {len(header)} columns; quote texts with commas")
        if row:
            texts[_without_suffix(row[header.index(name)].strip())] = " ".join(row[header.index("text")].split())
    return texts


def _header(cells: Iterable[str]) -> list[str]:
    return [cell.strip().lower() for cell in cells]


def _columns(path: Path) -> list[str]:
    return _header(next(iter(_cells(text_of(path, LONGEST_LINE).partition("\n")[0])), []))


def _cells(text: str) -> list[list[str]]:
    """Rows of a table with commas, or with the semicolons or tabs that spreadsheets write."""
    sign = separator_of(text.partition("\n")[0])
    return list(csv.reader(io.StringIO(text, newline=""), delimiter=sign, strict=True))


def _without_suffix(file: str) -> str:
    from facesynth.corpus.add.recordings import AUDIO, VIDEO

    return file[: -len(Path(file).suffix)] if Path(file).suffix.lower() in AUDIO | VIDEO else file
