"""import.csv: the account of every import into a corpus, for a person to read: what was used, what was not, and why."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from facesynth.atomic import write_text
from facesynth.corpus.add.given import Given
from facesynth.corpus.corpus import Corpus
from facesynth.corpus.record import Record

if TYPE_CHECKING:
    from facesynth.corpus.add.add import AddReport

COLUMNS = ("recording", "id", "used", "why", "phones", "files", "remarks")
Row = Mapping[str, str]


def account_path(corpus: Corpus) -> Path:
    """import.csv in the corpus' folder."""
    return corpus.path / "import.csv"


def write_account(corpus: Corpus, givens: Iterable[Given], paths: Iterable[str | Path], report: AddReport) -> None:
    """Write what became of each recording; what other imports said of others stays.

    It holds names and no folders' places, and says the same whether an import ran through or was interrupted and repeated.
    """
    rows = {row["recording"]: row for row in _read(account_path(corpus))}
    names = _Names(corpus, paths)
    for given in givens:
        if given.recording.name not in report.refused:
            rows[given.recording.name] = _used(corpus, corpus.record(given.id), given, report)
    for name, why in report.refused.items():
        rows[name] = {**dict.fromkeys(COLUMNS, ""), "recording": name, "used": "no", "why": names.without_places(why)}
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows[name] for name in sorted(rows))
    write_text(account_path(corpus), text.getvalue())


def phones_from(corpus: Corpus, record: Record) -> str:
    """Where an utterance's phones come from."""
    if not record.aligned_hash:
        return "given"
    if record.id in corpus.subset([record.id]).without_phones():
        return "not looked for"
    return "aligned to the words" if record.text else "recognised by ear"


def _used(corpus: Corpus, record: Record, given: Given, report: AddReport) -> Row:
    files = [f"{path.resolve().parent.name}/{path.name}" for path in given.files()]
    return {
        "recording": given.recording.name,
        "id": record.id,
        "used": "yes" if record.usable else "no",
        "why": report.kept.get(record.id, record.reason),
        "phones": phones_from(corpus, record),
        "files": "; ".join(files),
        "remarks": "; ".join(remark.strip() for remark in record.remarks.split("|") if remark.strip()),
    }


def _read(path: Path) -> list[Row]:
    """The rows of an account, as far as it can be read: a damaged one is written anew."""
    with suppress(OSError, UnicodeDecodeError, csv.Error):
        reader = csv.DictReader(io.StringIO(path.read_text(encoding="utf-8-sig"), newline=""))
        if tuple(reader.fieldnames or ()) == COLUMNS:
            return [{name: row[name] or "" for name in COLUMNS} for row in reader]
    return []


class _Names:
    """Messages name files with their place; an account that is copied to another computer does not need it."""

    def __init__(self, corpus: Corpus, paths: Iterable[str | Path]) -> None:
        folders = {str(path if path.is_dir() else path.parent) for path in map(Path, paths)}
        self._places = sorted((folder + os.sep for folder in folders), key=len, reverse=True)
        self._corpus = str(corpus.path)

    def without_places(self, message: str) -> str:
        for place in self._places:
            message = message.replace(place, "")
        return message.replace(self._corpus, "the corpus")
