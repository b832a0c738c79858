"""TextGrids and heads with one thing changed, and C3D files with one field changed by its name."""

import json
from dataclasses import replace

import c3d_files
import numpy as np
from grids import PHONES, WORDS, binary_grid, chronological_grid, json_grid, long_grid, short_grid
from heads import as_strips, head, names_in_primitive, outside, textured, vrm0, vrm0_mixing, vrm1, vrm1_mixing

FORMS = (long_grid, short_grid, chronological_grid, binary_grid, json_grid)
KINDS_OF_HEADS = (None, vrm0, vrm1, vrm0_mixing, vrm1_mixing, names_in_primitive, as_strips, textured("webp"), outside)
IN_TEXTS = ["", "-1", "1e999", "nan", '"', "<absent>", "99999999999", "0.5.5", "\\", "\x00", "é", "{", "[]", '"TextTier"', "5e8"]
IN_HEADS = [None, -1, 0, 1, 7, 2**31, 1e30, "x", "", [], {}, [0], [-1, 99], True, {"name": 3}, [None], "SCALAR", 5121]
NUMBERS = (0, 1, 2, 3, 5, 127, 128, 255, 256, 32767, 32768, 65535)
REALS = (0.0, -1.0, 1.0, 1e-30, 1e30, -120.0, 59.94, float("nan"), float("inf"))


def grid_changed(rng):
    """A TextGrid of any form: bytes changed, cut off, or one of its words replaced; and its suffix."""
    form, way = FORMS[rng.integers(len(FORMS))], int(rng.integers(3))
    content = form([("words", WORDS), ("A - phones", PHONES)])
    suffix = "json" if form is json_grid else "TextGrid"
    whole = content if isinstance(content, bytes) else content.encode(["utf-8", "utf-16", "utf-16-le"][rng.integers(3)])
    if way == 0:
        hurt = bytearray(whole)
        for place in rng.integers(0, len(hurt), rng.integers(1, 4)):
            hurt[place] = rng.integers(256)
        return bytes(hurt), suffix
    if way == 1 or isinstance(content, bytes):
        return whole[: rng.integers(0, len(whole))], suffix
    parts = content.split(" ")
    parts[rng.integers(len(parts))] = IN_TEXTS[rng.integers(len(IN_TEXTS))]
    return " ".join(parts).encode(), suffix


def whole_heads(folder):
    """The bytes of a valid head of each kind."""
    return [head(folder / "whole.glb", kind).read_bytes() for kind in KINDS_OF_HEADS]


def head_changed(wholes, rng):
    """A head of which one value of its document is replaced by another."""
    whole = wholes[rng.integers(len(wholes))]
    size = int.from_bytes(whole[12:16], "little")
    document = json.loads(whole[20 : 20 + size])
    places = list(places_of(document))
    holder, key = places[rng.integers(len(places))]
    holder[key] = IN_HEADS[rng.integers(len(IN_HEADS))]
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    rest = whole[20 + size :]
    return b"glTF" + np.array([2, 20 + len(text) + len(rest), len(text)], "<u4").tobytes() + b"JSON" + text + rest


def places_of(value):
    """Every place of a document whose value can be changed."""
    keys = value.keys() if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    for key in keys:
        yield value, key
        yield from places_of(value[key])


def c3d_changed(rng):
    """A C3D of any processor of which one field is changed: of the header, of a parameter, or the name of a group."""
    made = c3d_files.file(
        c3d_files.face(40),
        processor=int(rng.choice([c3d_files.INTEL, c3d_files.DEC, c3d_files.MIPS])),
        whole_numbers=bool(rng.random() < 0.5),
        more=[c3d_files.Parameter.texts(1, "ANGLES", ["HeadAngles"])],
    )
    way = rng.random()
    if way < 0.35:
        return c3d_files.content(_header_changed(made, rng))
    if way < 0.9:
        return c3d_files.content(_parameter_changed(made, rng))
    names = list(made.groups)
    names[rng.integers(len(names))] = str(rng.choice(["", "POINT", "ANALOG", "TRIAL", "X" * 100]))
    return c3d_files.content(replace(made, groups=tuple(names)))


def _header_changed(made, rng):
    name = str(rng.choice(sorted(c3d_files.PLACES)))
    kind = c3d_files.PLACES[name][1]
    value = float(rng.choice(REALS)) if kind == "f" else int(rng.choice(NUMBERS)) % (256 if kind == "B" else 65536)
    return replace(made, header={name: value})


def _parameter_changed(made, rng):
    number = int(rng.integers(len(made.parameters)))
    old, way = made.parameters[number], int(rng.integers(7))
    if way == 0:
        return replace(made, parameters=(*made.parameters[:number], *made.parameters[number + 1 :]))
    if way == 1:
        return replace(made, parameters=(*made.parameters, old))
    if way == 2:
        return made.with_parameter(
            number, replace(old, dimensions=tuple(int(d) for d in rng.choice(NUMBERS[:8], rng.integers(4))))
        )
    if way == 3:
        return made.with_parameter(
            number, replace(old, name=str(rng.choice(["X", "LABELS", "RATE", "LONG_FRAMES", "TYPE_GROUPS"])))
        )
    if way == 4:
        return made.with_parameter(number, replace(old, group=int(rng.choice([1, 2, 3, 127]))))
    return made.with_parameter(number, replace(old, value=_other_value(old, rng)))


def _other_value(old, rng):
    if old.kind == c3d_files.TEXT:
        return (str(rng.choice(["", "x", "\0" * 8, "m", "*", ":", "a:b", "é" * 300])),)
    if old.kind == c3d_files.FLOAT:
        return (float(rng.choice(REALS)),)
    return (int(rng.choice(NUMBERS)),)
