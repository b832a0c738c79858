"""Key shapes that somebody made by hand: a model without a recording, for any rig.

A table (CSV) has a row for each shape, with the phones that it is for, and a column for each channel of the rig. Phones that no
row names take the first shape that is given for a phone of their viseme class, so that fifteen rows are enough.
"""

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from facesynth.inference.arrays import Floats
from facesynth.inference.coarticulation.blending import KeyShapes, WeightModels
from facesynth.inference.coarticulation.model import CLASS_OF
from facesynth.inference.errors import FacesynthError, unknown
from facesynth.inference.layout import Layout
from facesynth.inference.phones import PHONE_INDEX, PHONES, VISEME_CLASSES
from facesynth.methods.coarticulation.keys import USUAL_S
from facesynth.methods.coarticulation.method import Coarticulation

HERE = Path(__file__).parent
SHIPPED = {"arkit": HERE / "arkit_shapes.csv"}
"""Tables that come with facesynth."""
COMMON = HERE / "common_weights.yaml"
PHONES_COLUMN = "phones"
FPS = 60.0
"""Of what is made, Hz."""


def from_table(table: str, settings: Mapping[str, Any]) -> Coarticulation:
    """A model from a CSV of shapes, or one that comes with facesynth, by its name; FacesynthError says what is wrong in it."""
    if settings:
        raise FacesynthError(f"shapes by hand are taken as they are; leave out the setting {sorted(settings)[0]!r}")
    path = SHIPPED.get(table, Path(table))
    names, shapes = read_shapes(path)
    model, width, common = Coarticulation(), len(names), common_weights()
    model.layout, model.fps, model.emotions = Layout("curves", names), FPS, ("neutral",)
    model.keep(np.zeros(width), np.eye(width), alone(shapes), common)
    model.facts = {"closed_gap": None, "shapes": path.name}
    licences = ["CC BY 4.0"] if table in SHIPPED else ["CC BY 4.0", "unknown"]
    source = yaml.safe_load(COMMON.read_text(encoding="utf-8"))["source"]
    model.provenance = {"performer": f"none: shapes by hand ({path.name})", "synthetic": True, "blended_as_in": source}
    model.provenance |= {"licences": licences, "consents": ["nobody was recorded for the shapes"]}
    return model.eval()


def common_weights() -> WeightModels:
    """The polynomials of all pairs of phones together, for every pair alike."""
    stored = yaml.safe_load(COMMON.read_text(encoding="utf-8"))
    common = np.array([stored["starting"], stored["ending"]], np.float64)
    size = len(VISEME_CLASSES)
    return WeightModels(np.tile(common, (size, size, 1, 1)), np.zeros((0, 3), np.int64), np.zeros((0, 3, common.shape[1])))


def alone(shapes: Floats) -> KeyShapes:
    """Shapes [N, D] of the phones that nothing around them changes."""
    size, width = len(VISEME_CLASSES), shapes.shape[1]
    pairs, singles = np.zeros((size, size, width)), np.zeros((size, width))
    return KeyShapes(shapes, pairs, pairs, singles, singles, singles, np.full(size, USUAL_S))


def read_shapes(path: Path) -> tuple[tuple[str, ...], Floats]:
    """Channels, and a shape [N, channels] for each of PHONES; FacesynthError with the line that cannot be used."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = [(number, [cell.strip() for cell in row]) for number, row in enumerate(csv.reader(file), 1) if any(row)]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FacesynthError(f"{path} cannot be read as a table of shapes ({error})") from None
    header = rows[0][1] if rows else []
    names = tuple(header[1:])
    if header[:1] != [PHONES_COLUMN] or not names or len(set(names)) != len(names) or "" in names:
        raise FacesynthError(f"{path}: wanted a column {PHONES_COLUMN} and one for each channel of the rig; got {header[:4]}")
    given: dict[int, Floats] = {}
    for line, row in rows[1:]:
        if len(row) != len(header):
            raise FacesynthError(f"{path}, line {line}: {len(row)} cells, but {len(header)} columns")
        shape = np.array([_weight(path, line, name, cell) for name, cell in zip(names, row[1:], strict=True)])
        for phone in _numbers(path, line, row[0]):
            if phone in given:
                raise FacesynthError(f"{path}, line {line}: {PHONES[phone]} has a shape already; name each phone once")
            given[phone] = shape
    return names, np.stack([_shape_of(path, phone, given) for phone in range(len(PHONES))])


def _numbers(path: Path, line: int, cell: str) -> list[int]:
    if not cell:
        raise FacesynthError(f"{path}, line {line}: which phones is this shape for?")
    for label in cell.split():
        if label not in PHONE_INDEX:
            raise FacesynthError(f"{path}, line {line}: {unknown('phone', label, PHONES)}")
    return [PHONE_INDEX[label] for label in cell.split()]


def _shape_of(path: Path, phone: int, given: Mapping[int, Floats]) -> Floats:
    """Its own, or the first that is given for a phone that looks alike."""
    alike = [other for other in given if CLASS_OF[other] == CLASS_OF[phone]]
    if not alike:
        raise FacesynthError(
            f"{path} has no shape for {PHONES[phone]}, nor for a phone that looks alike; "
            f"add one for {' '.join(VISEME_CLASSES[CLASS_OF[phone]])}"
        )
    return given[phone if phone in given else alike[0]]


def _weight(path: Path, line: int, name: str, cell: str) -> float:
    try:
        value = float(cell or 0)
    except ValueError:
        value = np.nan
    if not 0 <= value <= 1:
        raise FacesynthError(f"{path}, line {line}: {name} must be a weight from 0 to 1; got {cell!r}")
    return value
