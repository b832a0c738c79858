"""The evaluations of a search for settings, in a file that only grows: what was computed is not computed again."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from facesynth.inference.errors import FacesynthError

Row = Sequence[tuple[str, float]]
"""Settings: names and values."""


class TuningJournal:
    """Errors by settings and performer; one search's."""

    def __init__(self, path: Path, about: dict[str, Any]) -> None:
        """about: what the search depends on, as JSON can hold it; FacesynthError where the file is of something else."""
        self.path, self.errors = path, dict[str, float]()
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(json.dumps(about) + "\n", encoding="utf-8")
            return
        text = path.read_text(encoding="utf-8", errors="replace")
        lines = text.splitlines()
        if not lines or _complete(lines[0]) != about:
            raise FacesynthError(f"{path} belongs to another search, or to none; give another file, or remove it")
        self.errors = {row["key"]: row["error"] for row in map(_complete, lines[1:]) if {"key", "error"} <= row.keys()}
        if not text.endswith("\n"):  # an interruption cut the last line
            with path.open("a", encoding="utf-8") as file:
                file.write("\n")

    def knows(self, settings: Row, performer: str) -> bool:
        """Whether this was evaluated before."""
        return _key(settings, performer) in self.errors

    def error(self, settings: Row, performer: str) -> float:
        """What was found."""
        return self.errors[_key(settings, performer)]

    def keep(self, settings: Row, performer: str, error: float) -> None:
        """Remember what was found, in the file too."""
        key = _key(settings, performer)
        self.errors[key] = error
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps({"key": key, "error": error}) + "\n")


def _key(settings: Row, performer: str) -> str:
    return json.dumps([performer, {name: float(f"{value:.12g}") for name, value in sorted(settings)}])


def _complete(line: str) -> dict[str, Any]:
    """A line of the journal, or nothing for one that an interruption cut."""
    try:
        row = json.loads(line)
    except ValueError:
        return {}
    return row if isinstance(row, dict) else {}
