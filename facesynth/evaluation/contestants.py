"""Who is compared: a method with its settings, by name, by a settings file, or a family of variants from one file."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import torch
import yaml

from facesynth.config import load_config
from facesynth.corpus import Corpus
from facesynth.inference.errors import FacesynthError, unknown
from facesynth.methods.method import Method
from facesynth.methods.registry import capabilities_of, create, known_capabilities, method_class
from facesynth.methods.training import train

SECOND_TAKE = "second take"
"""The label of the row that is another recording of the same sentence."""
SAME_WORDS = "same words"
"""… and of the one that is put together from recordings of its words in other sentences."""
CLOSED = ", lips closed"
"""The end of a row's label where the lips of the row were closed at p, b and m by the same step as all others'."""
FAMILY_KEYS = ("title", "method", "include", "axis", "log", "curve", "variants")
OWN_KEYS = ("minutes", "speak", "method")
"""Keys of a variant that are not settings of its method."""


def is_recorded(label: str) -> bool:
    """Whether a row is made of recordings, and so competes with nobody."""
    return label.removesuffix(CLOSED) in (SECOND_TAKE, SAME_WORDS)


@dataclass(frozen=True)
class Contestant:
    """A method under a label that no other has."""

    label: str
    method: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    speak: Mapping[str, Any] = field(default_factory=dict)
    """Options of `Method.synthesize`."""
    minutes: float | None = None
    """Learn from so many minutes of each fold; None: from all."""

    def __post_init__(self) -> None:
        ours = is_recorded(self.label) or self.label.endswith(CLOSED)
        if ours or not re.fullmatch(r"\w[\w .+=,-]*", self.label) or self.label.endswith((" ", ".")):
            raise FacesynthError(
                f"{self.label!r} cannot be a method's label, which names a folder; use letters, digits and spaces"
            )

    def create(self) -> Method:
        """The method, untrained; unknown settings are answered with the nearest known one."""
        return create(self.method, **self.settings)

    def train(self, corpus: Corpus, seed: int, device: torch.device | None = None) -> Method:
        """The method, trained on a device."""
        return train(method_class(self.method), corpus, self.settings, seed=seed, device=device)

    def plain(self) -> dict[str, Any]:
        """Everything that decides what it makes, as JSON values; settings left out are the method's defaults."""
        return {
            "label": self.label,
            "method": self.method,
            "settings": self.create().config,
            "speak": dict(self.speak),
            "minutes": self.minutes,
        }


@dataclass(frozen=True)
class Family:
    """Variants of one method that a plot shows together."""

    title: str
    labels: tuple[str, ...]
    axis: str = ""
    """What the variants differ in: `minutes`, a setting, or nothing where they have no order."""
    values: tuple[float, ...] = ()
    """Each variant's place on the axis."""
    log: bool = False
    curve: str = ""
    """What the variants are called together, where they are one method under several settings: one curve of error
    against movement."""


def references(contestants: Sequence[Contestant] = ()) -> list[Contestant]:
    """The rows that every table has beside the second take, without which no figure can be judged.

    Of the parts of the face that the contestants move; where none are given, of all.
    """
    parts = {capabilities_of(one.method).part for one in contestants}
    parts |= {"mouth"} if "expression" in parts else set()
    known = [one for one in known_capabilities()[0] if one.reference]
    return [Contestant(one.reference, one.name) for one in known if not parts or one.part in parts]


def without_phones(rows: Sequence[Contestant], corpus: Corpus) -> tuple[list[Contestant], list[str]]:
    """The reference rows that a corpus can teach, and labels of those that ask for phones where it has none.

    A row whose method can do with the sound alone does with it there.
    """
    if not corpus.without_phones():
        return list(rows), []
    heard = [_by_sound(one) for one in rows]
    asking = [one.label for one in heard if one.create().needs_phones]
    return [one for one in heard if one.label not in asking], asking


def _by_sound(one: Contestant) -> Contestant:
    """The same, told nothing of what is said, where its method can do without."""
    settings = capabilities_of(one.method).by_sound
    if not settings or not one.create().needs_phones:
        return one
    return replace(one, label=f"{one.label} by sound", settings={**one.settings, **settings})


def contestant(spec: str) -> Contestant:
    """`efase`, or `efase:settings.yaml` under the name of the file."""
    name, _, config = spec.partition(":")
    method_class(name)
    settings = load_config(config) if config else {}
    settings.pop("device", None)  # of a comparison, all rows are made on one device
    one = Contestant(Path(config).stem if config else name, name, settings)
    one.create()
    return one


def by_minutes(contestants: Sequence[Contestant], minutes: Sequence[float]) -> tuple[list[Family], list[Contestant]]:
    """Each contestant again with so many minutes of every fold to learn from; a family of each."""
    families, variants = [], []
    for one in contestants if minutes else ():
        again = [replace(one, label=f"{one.label} {count:g} min", minutes=count) for count in sorted(set(minutes))]
        places = tuple(sorted(set(minutes)))
        families.append(
            Family(f"{one.label} by the minutes that it learned from", tuple(v.label for v in again), "minutes", places, log=True)
        )
        variants += again
    return families, variants


def check_labels(contestants: Sequence[Contestant]) -> None:
    """FacesynthError where two contestants share a label."""
    labels = [one.label.casefold() for one in contestants]
    for label in labels:
        if labels.count(label) > 1:
            raise FacesynthError(f"two methods are called {label!r}; give their settings files different names")


def read_family(path: str | Path) -> tuple[Family, list[Contestant]]:
    """A family and its variants from a YAML file: `title`, `method`, `variants`, perhaps `include`, `axis`, `log`, `curve`.

    `include` names a settings file beside it that all variants start from. `variants` maps a label to what differs:
    settings of the method, `minutes` to learn from, `speak` for options of the synthesis, or another `method`.
    """
    plain = load_family(Path(path))
    contestants = [_variant(plain, Path(path).parent, str(label), own or {}) for label, own in plain["variants"].items()]
    check_labels(contestants)
    axis = str(plain.get("axis") or "")
    values = tuple(_place(one, axis) for one in contestants) if axis else ()
    labels, curve = tuple(one.label for one in contestants), str(plain.get("curve") or "")
    return Family(str(plain["title"]), labels, axis, values, bool(plain.get("log")), curve), contestants


def load_family(path: Path) -> dict[str, Any]:
    """The file of a family, its keys checked."""
    try:
        plain = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise FacesynthError(f"{path}: cannot read a family of variants ({error})") from None
    if not isinstance(plain, dict) or not isinstance(plain.get("variants"), dict) or not {"title", "method"} <= set(plain):
        raise FacesynthError(f"{path}: a family needs title, method and variants, a mapping of labels to what differs")
    for key in plain:
        if key not in FAMILY_KEYS:
            raise unknown("key of a family", str(key), FAMILY_KEYS)
    return plain


def _variant(plain: Mapping[str, Any], folder: Path, label: str, own: Mapping[str, Any]) -> Contestant:
    base = load_config(folder / str(plain["include"])) if "include" in plain else {}
    settings = {key: value for key, value in own.items() if key not in OWN_KEYS}
    method = str(own.get("method", plain["method"]))
    base = base if method == plain["method"] else {}
    one = Contestant(label, method, {**base, **settings}, own.get("speak") or {}, own.get("minutes"))
    one.create()
    return one


def _place(one: Contestant, axis: str) -> float:
    value = one.minutes if axis == "minutes" else one.create().config.get(axis)
    if not isinstance(value, int | float):
        raise FacesynthError(f"variant {one.label!r} has no number for the axis {axis!r}")
    return float(value)
