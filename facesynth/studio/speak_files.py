"""A take as the plain files that `speak` takes, and the request and the command line that say the same."""

import csv
import io
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from facesynth.atomic import write_text
from facesynth.corpus.journal import ADDED, node_name, parse_node
from facesynth.inference.errors import FacesynthError, unknown
from facesynth.methods.capabilities import Capabilities
from facesynth.speech.emotions import write_emotions
from facesynth.speech.textgrid import write_textgrid
from facesynth.stage.request import Part, Request
from facesynth.studio.document import Document, Take

PHONES, EMOTIONS, CONSTRAINTS = "phones.TextGrid", "emotions.csv", "constraints.csv"
OF_REQUEST = ("seed", "mouth", "head", "eyes", "size")
"""What of `Request` a take may ask for, beside the model's own options."""
WHY = ".json"
"""Of the file that says why each phone got its motion."""
PINS, NODES = "constraints", "edits"
"""Own options of models that take nodes from a person: which must be used, and which were removed or drawn."""


def write_take(folder: Path, take: Take) -> None:
    """Write what `speak` reads of a take; what says the same already stays as it is."""
    write_textgrid(folder / PHONES, take.phone_track(), take.words)
    write_emotions(folder / EMOTIONS, take.emotion_track())
    write_text(folder / CONSTRAINTS, _constraints(take))


@dataclass(frozen=True)
class EditLines:
    """The edits of a project as a corpus keeps them."""

    lines: tuple[str, ...]
    drawn: tuple[str, ...]
    """Names of the drawn nodes: the numbers of the lines that add them."""


def edit_lines(document: Document, before: Sequence[str], kept: Sequence[str] = ()) -> EditLines:
    """Which nodes were drawn and removed, after the edits that the corpus had (`before`).

    kept: lines of this project that the corpus has taken over since. They stay as they are, for a journal only grows; what
    they say and the project does not say any more is taken back by further lines.
    """
    lines, names = [*before, *kept], list[str]()
    unmatched = [number for number in range(len(before) + 1, len(lines) + 1) if _edit(lines[number - 1])["op"] == "add"]
    for node in document.drawn:
        line = _line(op="add", phone=node.phone, emotion=node.emotion, title=node.title, frames=node.frames)
        number = next((number for number in unmatched if lines[number - 1] == line), None)
        if number is None:
            lines.append(line)
            names.append(node_name(ADDED, len(lines)))
        else:
            unmatched.remove(number)
            names.append(node_name(ADDED, number))
    gone, kept_gone = [*document.removed, *(node_name(ADDED, number) for number in unmatched)], _gone_by(kept)
    lines += [_line(op="remove", node=node) for node in gone if node not in kept_gone]
    lines += [_line(op="restore", node=node) for node in kept_gone if node not in gone]
    return EditLines(tuple(lines), tuple(names))


def _gone_by(lines: Sequence[str]) -> list[str]:
    """Nodes that these lines remove and do not restore."""
    gone: dict[str, None] = {}
    for edit in map(_edit, lines):
        if edit["op"] == "remove":
            gone[edit["node"]] = None
        elif edit["op"] == "restore":
            gone.pop(edit["node"], None)
    return list(gone)


def _line(**edit: Any) -> str:
    return json.dumps(edit, ensure_ascii=False)


def _edit(line: str) -> dict[str, Any]:
    return dict(json.loads(line))


def own_options(take: Take, model: Capabilities) -> dict[str, Any]:
    """The model's own options that a take asks for by a value, checked."""
    asked = {name: value for name, value in take.options if name not in OF_REQUEST}
    known = {option.name: option for option in model.options if option.type is not Path}
    for name in asked:
        if name not in known:
            raise unknown(f"option of {model.name}", name, (*OF_REQUEST, *known))
    return {name: known[name].checked(value) for name, value in asked.items()}


def request_of(take: Take, folder: Path, edits: Path | None, model: Capabilities, shown: Request | None = None) -> Request:
    """What is asked of `speak` for the files of a take; shown: on which head."""
    own: dict[str, Any] = dict(own_options(take, model))
    if take.pins and model.option(PINS):
        own[PINS] = folder / CONSTRAINTS
    if edits is not None and model.option(NODES):
        own[NODES] = edits
    said: dict[str, Any] = {"phones": folder / PHONES, "emotions": folder / EMOTIONS, "own": own}
    return replace(shown or Request(), **said, **of_request(take))


def of_request(take: Take) -> dict[str, Any]:
    """Fields of `Request` that a take asks for by a value."""
    return {name: _READ.get(name, _as_it_is)(value) for name, value in take.options if name in OF_REQUEST}


def arguments(model: Path, sound: Path, request: Request, take: Take, outputs: Sequence[Path]) -> list[str]:
    """The same on the command line, after `facesynth`."""
    words = ["speak", str(model), str(sound), "--phones", str(request.phones), "--emotions", str(request.emotions)]
    words += _flags({name: value for name in ("rig", "mapping") if (value := getattr(request, name)) is not None})
    words += _flags(request.own)
    words += _flags({name: value for name, value in take.options if name in OF_REQUEST})
    return [*words, *(word for output in outputs for word in ("--explain" if output.suffix == WHY else "-o", str(output)))]


def _as_it_is(value: Any) -> Any:
    return value


def _part(value: Any) -> Part:
    """Of head or eyes; a model of them is named on the command line alone, for it is a file."""
    part = Part.of(str(value))
    if part.model is not None:
        raise FacesynthError(f"wanted off, recorded or a factor such as 0.5; got {value!r:.40}")
    return part


def _size(value: Any) -> tuple[int, int]:
    width, _, height = str(value).partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise FacesynthError(f"size wants WIDTHxHEIGHT in pixels such as 1280x720; got {value!r:.40}")
    return int(width), int(height)


_READ: Mapping[str, Callable[[Any], Any]] = {"head": _part, "eyes": _part, "size": _size}


def _flags(values: Mapping[str, Any]) -> list[str]:
    return [word for name, value in values.items() for word in ("--" + name.replace("_", "-"), str(value))]


def _constraints(take: Take) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("phone_index", "utterance_id", "phone_number"))
    writer.writerows((pin.phone, *parse_node(pin.node)) for pin in take.pins)
    return text.getvalue()
