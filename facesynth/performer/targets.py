"""What each phone wants of jaw, lips and tongue, and how strongly: the table targets.csv."""

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Literal

import numpy as np
from numpy.typing import NDArray

CURVES: tuple[str, ...] = (
    "jaw_open",
    "jaw_forward",
    "pucker",
    "funnel",
    "stretch",
    "smile",
    "press",
    "roll_lower",
    "roll_upper",
    "lower_down",
    "upper_up",
    "shrug_upper",
    "tongue_out",
    "tongue_up",
)
"""The articulators' curves, 0..1: columns of the table and of an `Articulation`."""

SHAPES: Mapping[str, str] = {
    "jaw_open": "jawOpen",
    "jaw_forward": "jawForward",
    "pucker": "mouthPucker",
    "funnel": "mouthFunnel",
    "stretch": "mouthStretch",
    "smile": "mouthSmile",
    "press": "mouthPress",
    "roll_lower": "mouthRollLower",
    "roll_upper": "mouthRollUpper",
    "lower_down": "mouthLowerDown",
    "upper_up": "mouthUpperUp",
    "shrug_upper": "mouthShrugUpper",
    "tongue_out": "tongueOut",
}
"""ARKit shapes (of both sides) that the curves drive; the raised tongue has none."""

DIPHTHONGS: Mapping[str, tuple[str, str]] = {
    "ay": ("aa", "ih"),
    "aw": ("aa", "uw"),
    "ey": ("eh", "iy"),
    "ow": ("ow", "uw"),
    "oy": ("ao", "ih"),
}
"""Vowels that glide from one target to another; the row `ow` is the beginning of that vowel."""
GLIDE_AT = 0.55
"""Share of a diphthong's time that its first target has."""

Closes = Literal["lips", "teeth", "rest", ""]
Articulator = Literal["jaw", "lips", "opening", "tongue"]

ARTICULATORS: tuple[Articulator, ...] = tuple(
    "jaw" if name.startswith("jaw")
    else "tongue" if name.startswith("tongue") or name in ("press", "roll_lower", "roll_upper", "shrug_upper")
    else "opening" if name in ("lower_down", "upper_up")
    else "lips"
    for name in CURVES
)  # fmt: skip
"""Who moves each curve. Rolled and pressed lips are, like the tongue, claimed by every phone alike."""


@dataclass(frozen=True, eq=False)
class Target:
    """One row of the table."""

    phone: str
    pose: NDArray[np.float64]
    """[14] value of each curve, 0..1."""
    dominance: NDArray[np.float64]
    """[14] peak dominance of the phone over each curve."""
    early: float
    """Anticipation: factor of the time before the phone over which it is felt."""
    late: float
    """Carry-over: the same after it."""
    closes: Closes
    """What touches: the lips, lower lip and upper teeth, the lips at rest, or nothing."""


@cache
def load_targets() -> Mapping[str, Target]:
    """Rows of the table by phone."""
    return read_targets(files("facesynth.performer").joinpath("targets.csv").read_text(encoding="utf-8"))


def read_targets(text: str) -> dict[str, Target]:
    """Rows of a table, the text of a CSV, by phone."""
    return {row["phone"]: _target(row) for row in csv.DictReader(text.splitlines())}


def _target(row: Mapping[str, str]) -> Target:
    dominance = {who: float(row[f"{who}_dominance"]) for who in ("jaw", "lips", "opening")} | {"tongue": 1.0}
    closes: dict[str, Closes] = {"lips": "lips", "teeth": "teeth", "rest": "rest", "": ""}
    return Target(
        row["phone"],
        np.array([float(row[name]) for name in CURVES]),
        np.array([dominance[who] for who in ARTICULATORS]),
        float(row["early"]),
        float(row["late"]),
        closes[row["closes"]],
    )
