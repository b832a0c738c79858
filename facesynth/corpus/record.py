"""One line of utterances.csv: what is known of an utterance beside its signals."""

import csv
import io
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Literal, cast

from facesynth.atomic import write_text
from facesynth.corpus.files import check_id
from facesynth.encoding import text_of
from facesynth.inference.errors import FacesynthError, unknown

Split = Literal["train", "test", ""]
SPLITS: tuple[Split, ...] = ("train", "test", "")
_TRUTHS = {"yes": True, "true": True, "1": True, "no": False, "false": False, "0": False}


@dataclass(frozen=True)
class Record:
    """What is known of an utterance beside its signals."""

    id: str
    text: str = ""
    """The transcript, as far as it is known."""
    sentence: str = ""
    """Equal for the same words in other emotions and takes; empty: the text says."""
    emotion: str = "neutral"
    intensity: float = 1.0
    """0 (neutral) to 1 (as recorded)."""
    take: int = 1
    split: Split = ""
    """Where a person wants it; empty: left to `Corpus.split`."""
    usable: bool = True
    reason: str = ""
    """Why it is not usable."""
    licence: str = ""
    """Empty: the corpus' own."""
    consent: str = ""
    """Who agreed to what; empty: the corpus' own."""
    source_hash: str = ""
    """sha256 of sound and motion as they were added."""
    aligned_hash: str = ""
    """sha256 of the TextGrid that an aligner wrote; empty where a person gave the phones."""
    given: str = ""
    """A short hash of each thing that was given of the recording (`corpus.add.given`); empty where that is not known."""
    remarks: str = ""
    """What was noticed when it was added: of its motion | of its speech."""

    def __post_init__(self) -> None:
        check_id(self.id)
        if self.split not in SPLITS:
            raise unknown("split", self.split, ("train", "test"))
        if not 0 <= self.intensity <= 1:
            raise FacesynthError(f"utterance {self.id!r} has intensity {self.intensity}; wanted a number from 0 to 1")

    @property
    def sentence_key(self) -> str:
        """What splits go by: the sentence's name, else its words, else the id."""
        return self.sentence or plain_words(self.text) or self.id


COLUMNS = tuple(field.name for field in fields(Record))
STATED = ("text", "sentence", "emotion", "intensity", "take", "split", "usable", "reason", "licence", "consent")
"""Columns that a person fills."""


def plain_words(text: str) -> str:
    """Text without case and punctuation, so that one sentence written twice is one sentence."""
    kept = "".join(c if c.isalnum() or c == "'" else " " for c in text.casefold())
    return " ".join(kept.split())


def read_records(path: Path) -> dict[str, Record]:
    """Records by id; the error names the first line that is wrong."""
    records, faults = parse_records(path)
    if faults:
        raise FacesynthError(f"{path}{faults[0]}")
    return records


def read_listed(path: Path) -> dict[str, dict[str, Any]]:
    """What a table like utterances.csv, in any encoding, states of recordings, by name; an empty cell states nothing."""
    try:
        text = text_of(path)
        records, faults = _parsed(csv.DictReader(io.StringIO(text, newline=""), strict=True))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FacesynthError(f"{path} cannot be read as CSV ({error}); export it again") from None
    if faults:
        raise FacesynthError(f"{path}{faults[0]}")
    rows = csv.DictReader(io.StringIO(text, newline=""))
    stated = {row["id"]: [name for name, value in row.items() if value.strip() and name in STATED] for row in rows}
    return {name: {field: getattr(record, field) for field in stated[name]} for name, record in records.items()}


def parse_records(path: Path) -> tuple[dict[str, Record], list[str]]:
    """Records by id, and everything that is wrong with the file, each as `, line n: what`."""
    if not path.is_file():
        return {}, [" is missing; a corpus lists its utterances there"]
    try:
        reader = csv.DictReader(io.StringIO(path.read_text(encoding="utf-8-sig"), newline=""), strict=True)
        return _parsed(reader)
    except (UnicodeDecodeError, csv.Error) as error:
        return {}, [f" cannot be read as CSV in UTF-8 ({error}); export it again"]


def write_records(path: Path, records: Iterable[Record]) -> None:
    """Write utterances.csv, by id, atomically."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows([cell(getattr(r, name)) for name in COLUMNS] for r in sorted(records, key=lambda r: r.id))
    write_text(path, text.getvalue())


def _parsed(reader: "csv.DictReader[str]") -> tuple[dict[str, Record], list[str]]:
    columns = reader.fieldnames or ()
    faults = [f", line 1: {unknown('column', column, COLUMNS)}" for column in columns if column not in COLUMNS]
    if "id" not in columns:
        faults.append(f", line 1: there is no column 'id'; the columns are {','.join(COLUMNS)}")
    if faults:
        return {}, faults
    records: dict[str, Record] = {}
    folded: set[str] = set()
    for row in reader:
        try:
            record = _record(row)
            if record.id.casefold() in folded:
                raise FacesynthError(f"utterance {record.id!r} is listed twice; remove one")
        except ValueError as error:
            faults.append(f", line {reader.line_num}: {error}")
            continue
        folded.add(record.id.casefold())
        records[record.id] = record
    return records, faults


def _record(row: Mapping[str | None, str | None]) -> Record:
    if None in row or None in row.values():
        raise FacesynthError("the line has another number of cells than the first line")
    cells = cast("Mapping[str, str]", row)
    return Record(
        **{name: cells[name].strip() for name in ("text", "sentence", "reason", "licence", "consent") if name in cells},
        **{name: cells[name].strip() for name in ("source_hash", "aligned_hash", "given", "remarks") if name in cells},
        id=cells["id"],
        emotion=cells.get("emotion", "").strip() or "neutral",
        intensity=float(cells.get("intensity") or 1),
        take=int(cells.get("take") or 1),
        split=cast("Split", cells.get("split", "").strip()),
        usable=_truth(cells.get("usable") or "yes"),
    )


def _truth(cell: str) -> bool:
    if cell.strip().casefold() not in _TRUTHS:
        raise FacesynthError(f"usable must be yes or no; got {cell!r}")
    return _TRUTHS[cell.strip().casefold()]


def cell(value: object) -> str:
    """A field as utterances.csv spells it."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:g}" if isinstance(value, float) else str(value)
