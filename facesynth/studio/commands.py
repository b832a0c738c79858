"""Every change of a project by its name, with arguments as JSON brings them."""

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, get_origin

from facesynth.inference.errors import FacesynthError, unknown
from facesynth.studio import emotion_commands, line_commands, phone_commands
from facesynth.studio.document import Document, Take

Change = Callable[..., Any]
"""Of a document, or of a take: the same afterwards."""

CHANGES: Mapping[str, Change] = {
    change.__name__: change
    for change in (
        phone_commands.move_boundary,
        phone_commands.relabel,
        phone_commands.split_phone,
        phone_commands.join_phones,
        phone_commands.pin,
        phone_commands.unpin,
        emotion_commands.paint_emotion,
        emotion_commands.set_emotion,
        emotion_commands.move_emotion,
        emotion_commands.set_curve,
        emotion_commands.cross_fade,
        line_commands.add_line,
        line_commands.remove_line,
        line_commands.add_take,
        line_commands.remove_take,
        line_commands.set_phones,
        line_commands.set_option,
        line_commands.remove_node,
        line_commands.restore_node,
        line_commands.draw_node,
    )
}
_KINDS: Mapping[Any, tuple[tuple[type, ...], str]] = {
    str: ((str,), "a text"),
    int: ((int,), "a whole number"),
    float: ((int, float), "a number"),
    Mapping: ((dict,), "a mapping"),
    Sequence: ((list, tuple), "a list"),
}


def changed(document: Document, name: str, arguments: Mapping[str, Any]) -> Document:
    """The document after a change; FacesynthError, and nothing changed, for what cannot be done.

    A change of one take gets that take, and says in its arguments which take of which line it is.
    """
    if name not in CHANGES:
        raise unknown("change", name, CHANGES)
    change = CHANGES[name]
    (_, of), *rest = ((key, get_origin(p.annotation) or p.annotation) for key, p in inspect.signature(change).parameters.items())
    wanted = {**({"line": str, "take": str} if of is Take else {}), **dict(rest)}
    if set(arguments) != set(wanted):
        raise FacesynthError(f"{name} wants {', '.join(wanted)}; got {', '.join(arguments) or 'nothing'}")
    for key, value in arguments.items():
        _check(name, key, wanted[key], value)
    if of is Document:
        return change(document, **arguments)
    own = {key: value for key, value in arguments.items() if key not in ("line", "take")}
    return document.changing(arguments["line"], arguments["take"], lambda take: change(take, **own))


def _check(name: str, key: str, kind: Any, value: Any) -> None:
    kinds, said = _KINDS.get(kind, (None, ""))
    if kinds is not None and (not isinstance(value, kinds) or isinstance(value, bool)):
        raise FacesynthError(f"{name}: {key} must be {said}; got {value!r:.60}")
    if isinstance(value, float) and not math.isfinite(value):
        raise FacesynthError(f"{name}: {key} must be a finite number; got {value}")
