"""What is asked of a performance: parsed once, checked when it is made, and never changed."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any, Literal

from facesynth.inference.errors import FacesynthError, unknown

AUTO = "auto"
"""In place of an emotion, or of a track of emotions: as heard in the voice."""
SIDES_PX = (32, 4096)
RATES_HZ = (1, 1000)
SOURCES = ("default", "recorded", "off", "model")
DEFORMS = ("shapes", "distance", "regions")
PICTURES = ("coherent", "nearest")
FILES = ("phones", "detector", "maps", "expression", "explain", "rig", "mapping")

Source = Literal["default", "recorded", "off", "model"]
Deform = Literal["shapes", "distance", "regions"]
Pictures = Literal["coherent", "nearest"]


@dataclass(frozen=True)
class Part:
    """Who moves a part of the face beside the mouth, and how much."""

    source: Source = "default"
    """`recorded`: as the mouth's model knows it from its recordings, else still; `default`: the same, else as the
    package knows it from other people; `off`: still; `model`: as a model of this part alone says."""
    gain: float = 1.0
    """Factor on the motion."""
    model: Path | None = None
    """File of the model."""
    method: str = ""
    """Of the model, where whoever asked for it said so: `knn` or `head_knn` of a head."""

    @classmethod
    def of(cls, text: str) -> "Part":
        """`off`, `recorded`, a factor such as 0.5, or a model as [METHOD:]FILE[:FACTOR]."""
        if text in ("off", "recorded"):
            return cls("off" if text == "off" else "recorded")
        if (gain := _number(text)) is not None:
            return cls(gain=gain)
        method, file, factor = re.fullmatch(r"(?:([a-z_]{2,}):)?(.*?)(?::([\d.]+))?", text, re.DOTALL).groups()  # type: ignore[union-attr]
        return cls("model", float(factor or 1), Path(file), method or "")

    def __post_init__(self) -> None:
        if self.source not in SOURCES:
            raise unknown("source of a motion", self.source, SOURCES)
        if not 0 <= self.gain < float("inf"):
            raise FacesynthError(f"a factor on a motion must be 0 or above, such as 0.5; got {self.gain}")
        if (self.source == "model") != (self.model is not None):
            raise FacesynthError("a part that a model moves needs its file, and no other part has one")

    @property
    def factor(self) -> float:
        """The gain; 0 for a part that is off."""
        return 0.0 if self.source == "off" else self.gain


@dataclass(frozen=True)
class Request:
    """How speech is to be said. What is None is found, or left as it is."""

    text: str | None = None
    """What is said."""
    remarks: tuple[str, ...] = ()
    """What was assumed when this was put together, such as the encoding of a file; told with each recording."""
    phones: Path | None = None
    """A TextGrid, or lines of `end label`."""
    speaker: str | None = None
    """Whose phones are taken, where a TextGrid holds those of several."""
    language: str | None = None
    """Of the text (ISO 639-1); found out otherwise."""
    transcriber: Path | None = None
    """Folder of a model that writes down what is said, where no words are given."""
    emotion: str | None = None
    """One for everything, or AUTO."""
    emotions: str | Path | None = None
    """A file of emotions over time, or AUTO."""
    intensity: float | Path = 1.0
    """Of `emotion`, 0 to 1; or a file of intensities over time."""
    detector: Path | None = None
    """Hears the emotion; the one beside the model otherwise."""
    to_emotion: str | None = None
    """The motion is mapped to this emotion."""
    to_intensity: float = 1.0
    """Of `to_emotion`, 0 to 1."""
    maps: Path | None = None
    """A model whose maps `to_emotion` uses, where the mouth's own has none."""
    expression: Path | None = None
    """A model of expressions: it adds the emotions to the mouth's neutral motion."""
    own: Mapping[str, Any] = field(default_factory=dict)
    """Options of the mouth's own, by name; see `Capabilities.options`."""
    explain: Path | None = None
    """Where to write why each phone got its motion, as JSON."""
    head: Part = Part()
    eyes: Part = Part()
    mouth: float = 1.0
    """Factor on the movement of mouth and jaw; lips that are shut stay shut."""
    fps: Fraction | float | None = None
    """Of what is written, Hz; 30 on a head, that of the pictures of a real face."""
    size: tuple[int, int] | None = None
    """Width and height of the video, px; 1280 x 720 of a head, that of the pictures of a real face."""
    rig: Path | None = None
    """A head of one's own; the built-in one otherwise."""
    mapping: Path | None = None
    """Which of the head's (or the model's) own channels follow which ARKit weights; the file beside the head otherwise."""
    deform: Deform = "shapes"
    """What moves the skin in videos: the solved shapes, or the markers, by distance along the skin or by regions."""
    pictures: Pictures = "coherent"
    """Of a real face: recorded ones that follow each other well, or simply the nearest."""
    seed: int = 0

    def __post_init__(self) -> None:
        for name in FILES:
            if (path := getattr(self, name)) is not None:
                object.__setattr__(self, name, Path(path))
        if self.emotion is not None and self.emotions is not None:
            raise FacesynthError("both --emotion and --emotions were given; give one")
        if isinstance(self.intensity, str | Path):
            object.__setattr__(self, "intensity", Path(self.intensity))
        elif self.emotions is not None and str(self.emotions) != AUTO and self.intensity != 1:
            raise FacesynthError("--intensity weakens --emotion; in --emotions each line has an intensity of its own")
        if self.maps is not None and self.to_emotion is None:
            raise FacesynthError("--maps belongs to --to-emotion; say which emotion")
        for name in ("intensity", "to_intensity"):
            share = getattr(self, name)
            if not isinstance(share, Path) and not 0 <= share <= 1:
                raise FacesynthError(f"{name} must lie from 0 to 1; got {share:g}")
        for name, choices in (("deform", DEFORMS), ("pictures", PICTURES)):
            if getattr(self, name) not in choices:
                raise unknown(name, getattr(self, name), choices)
        _check_mouth(self.mouth, self.deform)
        if self.fps is not None and not RATES_HZ[0] <= self.fps <= RATES_HZ[1]:
            raise FacesynthError(f"a rate from {RATES_HZ[0]} to {RATES_HZ[1]} Hz is wanted; got {self.fps}")
        if self.size is not None:
            _check_size(self.size)

    @property
    def listens(self) -> bool:
        """Whether the emotion is to be heard in the voice."""
        return AUTO in (self.emotion, str(self.emotions))


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def _check_mouth(gain: float, deform: Deform) -> None:
    if not 0 <= gain < float("inf"):
        raise FacesynthError(f"--mouth is a factor of 0 or above, such as 1.3; got {gain}")
    if gain != 1 and deform != "shapes":
        raise FacesynthError(f"--mouth works on the solved shapes, which --deform {deform} does not show; leave one out")


def _check_size(size: tuple[int, int]) -> None:
    """FacesynthError for a size that H.264 cannot have: both sides are even."""
    if any(side % 2 or not SIDES_PX[0] <= side <= SIDES_PX[1] for side in size):
        wanted = f"WIDTHxHEIGHT, both even and from {SIDES_PX[0]} to {SIDES_PX[1]}, such as 1280x720"
        raise FacesynthError(f"--size wants {wanted}; got {'x'.join(map(str, size))}")
