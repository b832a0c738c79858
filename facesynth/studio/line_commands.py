"""Changes of a project's lines, their takes, and the nodes that may be used."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from facesynth.corpus.files import check_id
from facesynth.inference.errors import FacesynthError, unknown
from facesynth.studio.document import Document, Drawn, Line, Take, Word, check_phone, phone_of, settled, take_of


def add_line(document: Document, name: str, text: str, take: Mapping[str, Any], utterance: str) -> Document:
    """A new line, whose sound lies in the project already."""
    if any(line.name.casefold() == name.casefold() for line in document.lines):
        raise FacesynthError(f"there is a line {name!r} already; give this one another name")
    return replace(document, lines=(*document.lines, Line(check_id(name), text, (take_of(take),), utterance)))


def remove_line(document: Document, line: str) -> Document:
    """Take a line away; its sound stays in the project's folder, so that this can be undone."""
    gone = document.line(line)
    return replace(document, lines=tuple(other for other in document.lines if other is not gone))


def add_take(document: Document, line: str, take: str) -> Document:
    """A copy of a take, to be changed beside it."""
    found = document.line(line)
    numbers = [int(other.name) for other in found.takes]
    copy = replace(found.take(take), name=str(max(numbers) + 1))
    return document.with_line(replace(found, takes=(*found.takes, copy)))


def remove_take(document: Document, line: str, take: str) -> Document:
    """Take one away; a line keeps at least one."""
    found = document.line(line)
    gone = found.take(take)
    if len(found.takes) == 1:
        raise FacesynthError(f"{line} has this take alone; remove the line, or add another take first")
    return document.with_line(replace(found, takes=tuple(other for other in found.takes if other is not gone)))


def set_phones(
    document: Document, line: str, take: str, phones: Sequence[Sequence[Any]], words: Sequence[Sequence[Any]], text: str
) -> Document:
    """All phones anew, as an aligner placed them; pins go, for nobody knows which phones they belong to."""
    new = tuple(map(phone_of, phones))
    ends_s = [phone.end_s for phone in new]
    for phone in new:
        check_phone(phone.label)
    if not ends_s or any(a >= b for a, b in zip([0.0, *ends_s], ends_s, strict=False)):
        raise FacesynthError("phones need ends that rise from 0, and there must be one")

    def change(old: Take) -> Take:
        said = tuple(Word(str(label), float(start_s), float(end_s)) for label, start_s, end_s in words)
        if abs(new[-1].end_s - old.duration_s) > 1e-6:
            raise FacesynthError(f"the phones end at {new[-1].end_s:.3f} s, the sound at {old.duration_s:.3f} s")
        return settled(replace(old, phones=new, words=said, pins=()))

    changed = document.changing(line, take, change)
    return changed.with_line(replace(changed.line(line), text=text))


def set_option(old: Take, name: str, value: str | float | bool | None) -> Take:
    """Ask something of `speak`, such as seed or mouth; None: as it is by default."""
    options = {**dict(old.options), name: value}
    return replace(old, options=tuple(sorted((key, kept) for key, kept in options.items() if kept is not None)))


def remove_node(document: Document, node: str) -> Document:
    """A node must not be used; where it is constrained, the search may choose again."""
    if node in document.removed:
        raise FacesynthError(f"{node} is removed already")
    lines = [replace(line, takes=tuple(_without(take, node) for take in line.takes)) for line in document.lines]
    kept = [old if old == new else new for old, new in zip(document.lines, lines, strict=True)]
    return replace(document, lines=tuple(kept), removed=(*document.removed, node))


def restore_node(document: Document, node: str) -> Document:
    """A removed node may be used again."""
    if node not in document.removed:
        raise unknown("removed node", node, document.removed)
    return replace(document, removed=tuple(other for other in document.removed if other != node))


def draw_node(document: Document, title: str, phone: str, emotion: str, frames: Sequence[Sequence[float]]) -> Document:
    """A node that nobody recorded."""
    try:
        values = tuple(tuple(round(float(value), 4) for value in frame) for frame in frames)
    except (TypeError, ValueError):
        raise FacesynthError("the frames of a node are lists of numbers of equal length") from None
    if not values or len({len(frame) for frame in values}) != 1:
        raise FacesynthError("a drawn node needs at least one frame, all of equal length")
    return replace(document, drawn=(*document.drawn, Drawn(title, check_phone(phone), emotion, values)))


def _without(take: Take, node: str) -> Take:
    return replace(take, pins=tuple(pin for pin in take.pins if pin.node != node))
