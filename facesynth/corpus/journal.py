"""edits.jsonl: nodes that a person removed, restored, drew, or whose edit was taken back. It only grows; recordings stay.

A node is one phone of one utterance, called `utterance_id:phone_number`, counted from 0 in the utterance's phone
track. Drawn nodes are called `+:number` after the line that drew them; no utterance can be called so.
"""

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.atomic import write_text
from facesynth.inference.errors import FacesynthError

ADDED = "+"


@dataclass(frozen=True, eq=False)
class AddedNode:
    """A node that a person drew."""

    name: str
    phone: str
    emotion: str
    frames: NDArray[np.float32]
    """[L, C] in the layout's unit, at the corpus's rate."""
    title: str = ""
    """What the person called it."""


@dataclass(frozen=True, eq=False)
class Edits:
    """What a journal comes to."""

    removed: frozenset[str]
    """Names of nodes."""
    added: tuple[AddedNode, ...]
    """That were not removed again."""


@dataclass(frozen=True)
class Edit:
    """One line of the journal."""

    number: int
    op: str
    """remove, restore, add or undo."""
    facts: Mapping[str, Any]


def node_name(utterance_id: str, phone_number: int) -> str:
    """The name of a node, the same however often a database is rebuilt."""
    return f"{utterance_id}:{phone_number}"


def parse_node(name: str) -> tuple[str, int]:
    """Utterance id and phone number of a node's name."""
    utterance_id, _, number = name.rpartition(":")
    if not utterance_id or not (number.isascii() and number.isdigit()):
        raise FacesynthError(f"{name!r} is no node; wanted utterance_id:phone_number, such as s01_happy:4")
    return utterance_id, int(number)


class Journal:
    """The edits of one corpus, in the order in which they were made."""

    def __init__(self, path: Path) -> None:
        self.path = path

    @property
    def edits(self) -> tuple[Edit, ...]:
        """Every line, those that were undone later included."""
        return tuple(_edit(self.path, number, line) for number, line in enumerate(self._lines(), start=1))

    @property
    def in_force(self) -> tuple[Edit, ...]:
        """Edits that were not undone."""
        edits = self.edits
        undone = {edit.facts["of"] for edit in edits if edit.op == "undo"}
        return tuple(edit for edit in edits if edit.op != "undo" and edit.number not in undone)

    def removed(self) -> frozenset[str]:
        """Names of removed nodes."""
        return _removed(self.in_force)

    def added(self) -> tuple[AddedNode, ...]:
        """Added nodes that were not removed again."""
        return self.sum().added

    def sum(self) -> Edits:
        """What all edits that are in force come to."""
        edits = self.in_force
        removed = _removed(edits)
        nodes = (_added(edit) for edit in edits if edit.op == "add")
        return Edits(removed, tuple(node for node in nodes if node.name not in removed))

    def remove(self, node: str) -> None:
        """Remove a node; removing it again changes nothing."""
        if node not in self.removed():
            self._append("remove", node=node)

    def restore(self, node: str) -> None:
        """Take back the removal of a node; one that is not removed stays as it is."""
        if node in self.removed():
            self._append("restore", node=node)

    def add(self, phone: str, emotion: str, frames: NDArray[np.float32], title: str = "") -> AddedNode:
        """Add a node with its motion [L, C]; values are kept to 0.0001 of the layout's unit."""
        rounded = np.round(np.asarray(frames, np.float64), 4).tolist()
        named = {"title": title} if title else {}
        return _added(self._append("add", phone=phone, emotion=emotion, **named, frames=rounded))

    def undo(self) -> Edit:
        """Take back the newest edit that is in force, and return it."""
        if not self.in_force:
            raise FacesynthError(f"{self.path}: there is nothing to undo")
        last = self.in_force[-1]
        self._append("undo", of=last.number)
        return last

    def _lines(self) -> list[str]:
        if not self.path.is_file():
            return []
        try:
            return self.path.read_text(encoding="utf-8").splitlines()
        except UnicodeDecodeError:
            raise FacesynthError(f"{self.path} is not text in UTF-8") from None

    def _append(self, op: str, **facts: Any) -> Edit:
        """The file is replaced by a longer one, so that no reader ever finds half a line."""
        lines = self._lines()
        lines.append(json.dumps({"op": op, **facts}, ensure_ascii=False))
        write_text(self.path, "\n".join(lines) + "\n")
        return Edit(len(lines), op, facts)


_FIELDS: Mapping[str, Mapping[str, Callable[[Any], bool]]] = {
    "remove": {"node": lambda value: isinstance(value, str)},
    "restore": {"node": lambda value: isinstance(value, str)},
    "add": {
        "phone": lambda value: isinstance(value, str),
        "emotion": lambda value: isinstance(value, str),
        "frames": lambda value: isinstance(value, list) and len(value) > 0,
    },
    "undo": {"of": lambda value: isinstance(value, int)},
}


def _edit(path: Path, number: int, line: str) -> Edit:
    try:
        facts = json.loads(line)
    except json.JSONDecodeError as error:
        raise FacesynthError(f"{path}, line {number}: not JSON ({error.msg}); mend or delete the line") from None
    op = facts.pop("op", None) if isinstance(facts, dict) else None
    wanted = _FIELDS.get(str(op))
    if wanted is None or not all(name in facts and fits(facts[name]) for name, fits in wanted.items()):
        raise FacesynthError(
            f"{path}, line {number}: not an edit (remove or restore with node, add with phone, emotion and frames, undo with of)"
        )
    return Edit(number, str(op), facts)


def _removed(edits: Iterable[Edit]) -> frozenset[str]:
    removed: set[str] = set()
    for edit in edits:
        if edit.op == "remove":
            removed.add(edit.facts["node"])
        elif edit.op == "restore":
            removed.discard(edit.facts["node"])
    return frozenset(removed)


def _added(edit: Edit) -> AddedNode:
    name = node_name(ADDED, edit.number)
    try:
        frames = np.array(edit.facts["frames"], np.float32)
    except (ValueError, TypeError):
        raise FacesynthError(f"added node {name}: its frames are not lists of numbers of equal length") from None
    return AddedNode(name, edit.facts["phone"], edit.facts["emotion"], frames, str(edit.facts.get("title", "")))
