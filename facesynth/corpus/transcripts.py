"""What is said in many recordings, in one table."""

from __future__ import annotations

import csv
import io
from pathlib import Path

from facesynth.errors import FacesynthError

_NAMES = ("id", "file", "name")


def read_transcripts(path: str | Path) -> dict[str, str]:
    """Texts by recording from a CSV with the columns `id` (or `file`) and `text`; a file's suffix is left out."""
    path = Path(path)
    try:
        rows = list(csv.reader(io.StringIO(path.read_text(encoding="utf-8-sig"), newline=""), strict=True))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FacesynthError(f"{path} cannot be read as CSV in UTF-8 ({error})") from None
    header = [cell.strip().lower() for cell in rows[0]] if rows else []
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


def _without_suffix(file: str) -> str:
    from facesynth.corpus.recordings import AUDIO, VIDEO

    return file[: -len(Path(file).suffix)] if Path(file).suffix.lower() in AUDIO | VIDEO else file
