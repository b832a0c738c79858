"""What goes over the socket: JSON, and binary messages of a JSON header and numbers."""

import json
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.errors import FacesynthError
from facesynth.studio.document import Line, take_facts
from facesynth.studio.performing import Shown
from facesynth.studio.project import Project


def parsed(text: str) -> dict[str, Any]:
    """A message of the page; FacesynthError for anything that is none."""
    try:
        message = json.loads(text)
    except ValueError:
        raise FacesynthError("a message is JSON") from None
    if not isinstance(message, dict) or not isinstance(message.get("op"), str):
        raise FacesynthError("a message is a mapping with an 'op'")
    return message


def packed(header: Mapping[str, Any], numbers: NDArray[Any]) -> bytes:
    """Length of the header (uint32, little-endian), the header padded to four bytes, then float32 numbers."""
    text = json.dumps(header, ensure_ascii=False).encode()
    text += b" " * (-len(text) % 4)
    return len(text).to_bytes(4, "little") + text + np.ascontiguousarray(numbers, "<f4").tobytes()


def face_message(shown: Shown, **about: Any) -> bytes:
    """A stretch of a face in motion."""
    header = {"kind": "face", "fps": shown.fps, "start": shown.start, "count": shown.count, "names": shown.names}
    return packed({**header, "columns": shown.rows.shape[1], **about}, shown.rows)


def project_facts(project: Project, lines: Collection[str] | None = None) -> dict[str, Any]:
    """The state of a project for the page: of all lines, or of those that changed."""
    document = project.document
    shown = [line_facts(line) for line in document.lines if lines is None or line.name in lines]
    return {
        "revision": project.revision,
        "can_undo": project.can_undo,
        "can_redo": project.can_redo,
        "order": [line.name for line in document.lines],
        "lines": shown,
        "removed": document.removed,
        "drawn": drawn_facts(project),
    }


def drawn_facts(project: Project) -> list[dict[str, Any]]:
    """Drawn nodes without their frames."""
    return [
        {"node": name, "title": node.title, "phone": node.phone, "emotion": node.emotion, "frames": len(node.frames)}
        for name, node in project.drawn
    ]


def line_facts(line: Line) -> dict[str, Any]:
    """A line as JSON can hold it."""
    takes = [take_facts(take) for take in line.takes]
    return {"name": line.name, "text": line.text, "utterance": line.utterance, "takes": takes}
