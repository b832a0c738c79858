"""A model's card: what it learned from, under which licence, how good it is, where it ends, how it is made again."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import yaml

from facesynth.atomic import write_text
from facesynth.inference.errors import FacesynthError, unknown

LARGEST_CARD_BYTES = 1 << 18
UNKNOWN = "unknown"


@dataclass(frozen=True)
class Figure:
    """Something measured."""

    what: str
    """With unit, and on which recordings."""
    value: float
    command: str
    """That measured it."""
    found_by: str = ""
    """Regular expression whose group finds the value in what the command prints; `benchmarks/cards.py` measures it again."""


@dataclass(frozen=True)
class Card:
    """What whoever takes a model must know; a card without a licence is none."""

    title: str
    performer: str
    """Who was recorded."""
    languages: tuple[str, ...]
    """Of the recordings, as BCP 47 tags."""
    licence: str
    """Of the recordings that it learned from, with whom to name."""
    consent: str
    """Who agreed to what."""
    rebuild: str = ""
    """The command that makes it again, to the byte, where the recordings are there."""
    figures: tuple[Figure, ...] = ()
    limits: tuple[str, ...] = ()
    """What it cannot do, or was not tried on."""
    notes: str = ""

    def __post_init__(self) -> None:
        for name in ("title", "performer", "licence", "consent"):
            if not isinstance(value := getattr(self, name), str) or not value.strip():
                raise FacesynthError(f"a card needs {name}; got {value!r}: say unknown where nobody knows it")


def read_card(path: str | Path) -> Card:
    """A card from its YAML; FacesynthError, naming the field, for what is none."""
    path = Path(path)
    try:
        if path.stat().st_size > LARGEST_CARD_BYTES:
            raise FacesynthError(f"{path} is too large for a card")
        stated = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise FacesynthError(f"{path}: cannot read the card ({' '.join(str(error).split())})") from None
    try:
        return card_of(stated)
    except FacesynthError as error:
        raise FacesynthError(f"{path}: {error}") from None


def card_of(stated: Any) -> Card:
    """A card from what YAML holds; FacesynthError for a field that is missing, unknown or of another kind."""
    if not isinstance(stated, Mapping):
        raise FacesynthError(f"a card is a list of fields such as licence: CC0; got {stated!r:.60}")
    known = [one.name for one in fields(Card)]
    for name in stated:
        if name not in known:
            raise unknown("field of a card", str(name), known)
    if lacking := [name for name in ("title", "performer", "languages", "licence", "consent") if name not in stated]:
        raise FacesynthError(f"the card lacks {', '.join(lacking)}: say unknown where nobody knows it")
    try:
        figures = tuple(map(_figure_of, stated.get("figures") or ()))
    except (TypeError, KeyError, ValueError) as error:
        raise FacesynthError(f"each figure of a card needs what, value and command ({error!r})") from None
    lists = {name: tuple(map(str, stated.get(name) or ())) for name in ("languages", "limits")}
    return Card(**{**stated, **lists, "figures": figures})


def _figure_of(stated: Mapping[str, Any]) -> Figure:
    return Figure(str(stated["what"]), float(stated["value"]), str(stated["command"]), str(stated.get("found_by", "")))


def write_card(path: str | Path, card: Card) -> None:
    """Write it as YAML, in the order of its fields."""
    plain = {name: value for name, value in asdict(card).items() if value not in ("", ())}
    for name in ("languages", "limits"):
        if name in plain:
            plain[name] = list(plain[name])
    if card.figures:
        plain["figures"] = [{name: value for name, value in figure.items() if value != ""} for figure in plain["figures"]]
    write_text(path, yaml.safe_dump(plain, sort_keys=False, allow_unicode=True, width=110))


def draft(title: str, provenance: Mapping[str, Any]) -> Card:
    """A card to be completed by hand: what a model itself states of the recordings that it learned from."""
    licence, consent = ("; ".join(filter(None, map(str, provenance.get(name) or ()))) for name in ("licences", "consents"))
    return Card(
        title=title,
        performer=str(provenance.get("performer") or UNKNOWN),
        languages=("und",),
        licence=licence or UNKNOWN,
        consent=consent or UNKNOWN,
        limits=("not measured: see `facesynth evaluate`",),
    )
