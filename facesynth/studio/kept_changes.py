"""journal.jsonl of a project: every change, on the disk before it counts as made. It only grows."""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from facesynth.inference.errors import FacesynthError

UNDO, REDO = "undo", "redo"


@dataclass(frozen=True)
class Change:
    """One line of the journal."""

    do: str
    """Name of a change, or UNDO or REDO."""
    arguments: Mapping[str, Any]


class KeptChanges:
    """The journal of one project, for whoever holds the project's lock."""

    def __init__(self, path: Path) -> None:
        self.path = path

    @classmethod
    def opened(cls, path: Path) -> tuple[Self, list[Change]]:
        """The journal and what it holds; half a line at its end, which was never told to be kept, is taken off.

        FacesynthError, naming the line, where anything else is damaged.
        """
        changes, whole_bytes = _read(path)
        if path.exists() and whole_bytes < path.stat().st_size:
            with path.open("r+b") as file:
                file.truncate(whole_bytes)
                os.fsync(file.fileno())
        path.touch()
        _sync_folder(path.parent)
        return cls(path), changes

    def keep(self, change: Change) -> None:
        """Append a change; when this returns it outlives the program and, as far as the disk tells the truth, the machine."""
        line = json.dumps({"do": change.do, "with": change.arguments}, ensure_ascii=False, separators=(",", ":"))
        with self.path.open("ab") as file:
            file.write(line.encode() + b"\n")
            file.flush()
            os.fsync(file.fileno())


def _read(path: Path) -> tuple[list[Change], int]:
    """The changes, and the bytes of the whole lines."""
    if not path.is_file():
        return [], 0
    data = path.read_bytes()
    whole = data.rfind(b"\n") + 1
    lines = data[:whole].split(b"\n")[:-1]
    return [_change(path, number, line) for number, line in enumerate(lines, start=1)], whole


def _change(path: Path, number: int, line: bytes) -> Change:
    try:
        said = json.loads(line)
        return Change(str(said["do"]), dict(said["with"]))
    except (ValueError, KeyError, TypeError):
        raise FacesynthError(
            f"{path}, line {number} is damaged: {line[:40]!r} is no change; restore the file from a copy,"
            " or delete this line and all after it to go on from there"
        ) from None


def _sync_folder(folder: Path) -> None:
    """Make the name of a new file outlive the machine; systems that open no folders do so by themselves."""
    if not hasattr(os, "O_DIRECTORY"):
        return
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
