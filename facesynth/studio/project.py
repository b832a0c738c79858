"""A project on disk: lines that are worked on, every change of them, and the plain files that `speak` takes.

- `project.json`: of which corpus and model it is
- `journal.jsonl`: every change; replayed when the project is opened
- `lines/NAME/NAME.wav`: the sound of a line
- `lines/NAME/TAKE/`: `phones.TextGrid`, `emotions.csv`, `constraints.csv`, which `speak` takes; written after each change
- `edits.jsonl`: nodes that were removed and drawn, after those edits that the corpus had (`corpus-edits.jsonl`)
- `kept-edits.jsonl`: those of them that the corpus has taken over
- `exports/`: what was exported
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from filelock import FileLock, Timeout
from numpy.typing import NDArray

from facesynth.atomic import write_text
from facesynth.corpus.files import check_id
from facesynth.inference.errors import FacesynthError, unknown
from facesynth.speech.audio import as_saved, save_wav
from facesynth.studio.commands import CHANGES, changed
from facesynth.studio.document import Document, Drawn, Line
from facesynth.studio.kept_changes import REDO, UNDO, Change, KeptChanges
from facesynth.studio.speak_files import EditLines, edit_lines, write_take

FORMAT = 1
EDITS, BEFORE, TAKEN = "edits.jsonl", "corpus-edits.jsonl", "kept-edits.jsonl"
NODES = "nodes"
"""In place of a line's name: the nodes that may be used."""


@dataclass(frozen=True)
class Kept:
    """A change that was made and is kept."""

    revision: int
    lines: tuple[str, ...]
    """Names of lines that are new, changed or gone."""
    nodes: bool
    """Whether other nodes may be used now."""


class Project:
    """Lines with undo and redo; whoever has it open holds its lock."""

    def __init__(self, folder: Path, lock: FileLock, journal: KeptChanges, changes: list[Change]) -> None:
        self.folder = folder
        self.document = Document()
        self.revision = 0
        self.changed_at: dict[str, int] = {}
        """Revision at which each line, and NODES, changed last."""
        self._lock, self._journal = lock, journal
        self._before, self._taken = _lines(folder / BEFORE), _lines(folder / TAKEN)
        self._past: list[Document] = []
        self._future: list[Document] = []
        for number, change in enumerate(changes, start=1):
            try:
                self._make(change)
            except FacesynthError as error:
                raise FacesynthError(f"{journal.path}, line {number} cannot be done: {error}; restore it from a copy") from None
        self._write_all()

    @classmethod
    def open(cls, folder: str | Path, corpus: Path | None = None, model: Path | None = None) -> Self:
        """Open a project, or begin one for a corpus and a model; FacesynthError where another program has it open."""
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        lock = FileLock(folder / ".lock")
        try:
            lock.acquire(timeout=0)
        except Timeout:
            raise FacesynthError(f"{folder} is open in another studio; close that one, or give another --project") from None
        try:
            _keep_facts(folder, corpus, model)
            _keep_edits(folder, corpus)
            return cls(folder, lock, *KeptChanges.opened(folder / "journal.jsonl"))
        except BaseException:
            lock.release()
            raise

    def close(self) -> None:
        """Let others open it; everything was kept before."""
        self._lock.release()

    @property
    def can_undo(self) -> bool:
        """Whether there is something to take back."""
        return bool(self._past)

    @property
    def can_redo(self) -> bool:
        """Whether there is something to make again."""
        return bool(self._future)

    def change(self, do: str, arguments: Mapping[str, Any], base: int | None = None) -> Kept:
        """Make a change, UNDO or REDO, and keep it; FacesynthError, and nothing changed, for what cannot be done.

        base: the revision that whoever asks has seen. What changed since, by another window, is not changed unseen.
        """
        self._require_seen(do, arguments, self.revision if base is None else base)
        change = Change(do, dict(arguments))
        document = self._after(change)
        self._journal.keep(change)
        kept = self._move(change, document)
        self._write(kept)
        return kept

    def trial(self, do: str, arguments: Mapping[str, Any]) -> Document:
        """What a change would make, while a boundary is still being dragged; nothing is kept."""
        return changed(self.document, do, arguments)

    def sound(self, line: str) -> Path:
        """The file of a line's sound."""
        return self.folder / "lines" / check_id(line) / f"{line}.wav"

    def take_folder(self, line: str, take: str) -> Path:
        """Where the files of a take are."""
        return self.folder / "lines" / check_id(line) / check_id(take)

    @property
    def edits(self) -> Path | None:
        """The file of removed and drawn nodes; None where there are none."""
        return self.folder / EDITS if self.document.removed or self.document.drawn or self._taken else None

    @property
    def drawn(self) -> list[tuple[str, Drawn]]:
        """The drawn nodes under the names by which they are constrained and removed."""
        return list(zip(self._edit_lines().drawn, self.document.drawn, strict=True))

    def keep_edits(self, corpus: Path) -> int:
        """Let the corpus take over which nodes were removed and drawn, for whatever learns from it; gives how many lines are new.

        FacesynthError where the corpus's edits are not those that the project goes on from, and where nothing is new.
        """
        there, wanted = _lines(corpus / EDITS), self._edit_lines().lines
        known = (*self._before, *self._taken)
        if there not in (known, wanted):
            raise FacesynthError(
                f"{corpus / EDITS} was changed elsewhere since this project began; see them by `facesynth corpus edit list`,"
                " and begin a new project that goes on from them"
            )
        if wanted == known:
            raise FacesynthError("the corpus has all of these edits already")
        write_text(corpus / EDITS, _text(wanted))
        write_text(self.folder / TAKEN, _text(wanted[len(self._before) :]))
        self._taken = wanted[len(self._before) :]
        return len(wanted) - len(known)

    def keep_sound(self, line: str, audio: NDArray[np.float32], rate: int) -> NDArray[np.float32]:
        """Write a line's sound before the line is added; gives what will be read back. Another line's is refused."""
        path = self.sound(line)
        if any(known.name.casefold() == line.casefold() for known in self.document.lines):
            raise FacesynthError(f"there is a line {line!r} already; give this one another name")
        save_wav(path, audio, rate)
        return as_saved(audio, rate)

    def keep_facts(self, *, model: Path) -> None:
        """Remember another model."""
        _keep_facts(self.folder, None, model)

    def _require_seen(self, do: str, arguments: Mapping[str, Any], base: int) -> None:
        if do in (UNDO, REDO):
            unseen = base != self.revision
        else:
            touched = arguments.get("line") if "line" in arguments else NODES
            unseen = base < self.changed_at.get(str(touched), 0)
        if unseen:
            raise FacesynthError("another window changed this meanwhile; it is shown now: look at it, then do it again")

    def _make(self, change: Change) -> None:
        self._move(change, self._after(change))

    def _after(self, change: Change) -> Document:
        """The document after a change."""
        if change.do in (UNDO, REDO):
            stack = self._past if change.do == UNDO else self._future
            if not stack:
                raise FacesynthError(f"there is nothing to {change.do}")
            return stack[-1]
        if change.do not in CHANGES:
            raise unknown("change", change.do, (*CHANGES, UNDO, REDO))
        return changed(self.document, change.do, change.arguments)

    def _move(self, change: Change, document: Document) -> Kept:
        """Go on to the next revision."""
        before = self.document
        if change.do == UNDO:
            self._future.append(before)
            self._past.pop()
        elif change.do == REDO:
            self._past.append(before)
            self._future.pop()
        else:
            self._past.append(before)
            self._future.clear()
        self.document, self.revision = document, self.revision + 1
        nodes = (before.removed, before.drawn) != (document.removed, document.drawn)
        kept = Kept(self.revision, _differing(before, document), nodes)
        self.changed_at |= dict.fromkeys([*kept.lines, *([NODES] if kept.nodes else [])], self.revision)
        return kept

    def _write(self, kept: Kept) -> None:
        for line in self.document.lines:
            if line.name in kept.lines:
                self._write_line(line)
        if kept.nodes:
            self._write_edits()

    def _write_line(self, line: Line) -> None:
        for take in line.takes:
            write_take(self.take_folder(line.name, take.name), take)

    def _write_all(self) -> None:
        for line in self.document.lines:
            if not self.sound(line.name).is_file():
                raise FacesynthError(f"{self.sound(line.name)} is missing; restore it from a copy")
            self._write_line(line)
        self._write_edits()

    def _write_edits(self) -> None:
        write_text(self.folder / EDITS, _text(self._edit_lines().lines))

    def _edit_lines(self) -> EditLines:
        return edit_lines(self.document, self._before, self._taken)


def read_facts(folder: Path) -> dict[str, str]:
    """Paths of the corpus and the model of a project; empty where there is none."""
    path = folder / "project.json"
    if not path.is_file():
        return {}
    try:
        said = json.loads(path.read_text(encoding="utf-8"))
        facts = {key: str(said[key]) for key in ("corpus", "model")}
        number = int(said["format"])
    except (ValueError, KeyError, TypeError):
        raise FacesynthError(f"{path} is damaged; restore it from a copy, or delete it to name corpus and model anew") from None
    if number != FORMAT:
        raise FacesynthError(f"{path} is of format {number}; this facesynth reads {FORMAT}")
    return facts


def _keep_facts(folder: Path, corpus: Path | None, model: Path | None) -> None:
    known = read_facts(folder)
    given = {"corpus": str(corpus or known.get("corpus", "")), "model": str(model or known.get("model", ""))}
    if given != known:
        write_text(folder / "project.json", json.dumps({"format": FORMAT, **given}, indent=1) + "\n")


def _keep_edits(folder: Path, corpus: Path | None) -> None:
    """Keep the edits that the corpus has when a project begins: drawn nodes are called by the line that adds them."""
    there = corpus / EDITS if corpus else None
    if not (folder / "journal.jsonl").exists() and there is not None and there.is_file():
        write_text(folder / BEFORE, _text(_lines(there)))


def _lines(path: Path) -> tuple[str, ...]:
    return tuple(path.read_text(encoding="utf-8").splitlines()) if path.is_file() else ()


def _text(lines: Sequence[str]) -> str:
    return "".join(line + "\n" for line in lines)


def _differing(before: Document, after: Document) -> tuple[str, ...]:
    old, new = ({line.name: line for line in document.lines} for document in (before, after))
    return tuple(name for name in {**old, **new} if old.get(name) is not new.get(name))
