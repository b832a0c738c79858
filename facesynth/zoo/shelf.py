"""Models by name: those that come with the package, and those that the user pulled; and the one for those who name none."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from facesynth.cache import cache_dir
from facesynth.inference.errors import unknown
from facesynth.inference.folder import CARD, MANIFEST, open_folder, place_of
from facesynth.methods.registry import load_trained
from facesynth.zoo.card import Card, read_card

if TYPE_CHECKING:
    from facesynth.methods.trained import TrainedModel

PACKAGED = Path(__file__).with_name("models")
DEFAULT = "grid-s1-network"
"""The mouth of those who name no model."""
SUFFIX = ".safetensors"
"""Of a model's own file."""


@dataclass(frozen=True)
class Entry:
    """A model on the shelf."""

    name: str
    path: Path
    """Its folder, as `facesynth export` wrote it, with a card."""
    method: str
    part: str
    """Of the face: what it moves."""
    layout: str
    """Kind of its motion, and how many channels."""
    size_bytes: int
    """Of all files that it needs, those too that others of the package need."""
    card: Card


def names() -> Mapping[str, Path]:
    """Folders by the names of their models; what the user pulled does not hide what comes with the package."""
    pulled = {path.name: path for path in sorted(_pulled().iterdir()) if (path / MANIFEST).is_file()}
    return pulled | {path.name: path for path in sorted(PACKAGED.iterdir()) if (path / MANIFEST).is_file()}


def entry(name: str) -> Entry:
    """A model by its name; FacesynthError with the nearest names, or with what is wrong with its folder or card."""
    known = names()
    if name not in known:
        raise unknown("model", name, known)
    return entry_of(known[name])


def entry_of(path: Path) -> Entry:
    """A folder whose files have been compared with their hashes."""
    from facesynth.methods.registry import capabilities_of

    folder, card = open_folder(path), read_card(path / CARD)
    method, layout = str(folder.manifest["method"]), folder.layout
    size = sum(place_of(path, name).stat().st_size for name in (*folder.contents, MANIFEST, CARD))
    part = capabilities_of(method).part
    return Entry(path.name, path, method, part, f"{layout.channels} {layout.kind}", size, card)


def find(model: str | Path) -> Path:
    """A model's file or folder, or the folder of a model by its name; FacesynthError with the nearest names."""
    path = Path(model)
    if path.exists():
        return path
    known = names()
    if str(model) not in known:
        raise unknown("model", str(model), known)
    return known[str(model)]


def load(model: str | Path = DEFAULT) -> TrainedModel:
    """A trained model: from its file, from an exported folder, or by its name (`facesynth models` lists them)."""
    return load_trained(find(model))


def is_model(given: Path) -> bool:
    """Whether something names a model, rather than a recording to be spoken."""
    return given.suffix.lower() == SUFFIX or (given / MANIFEST).is_file() or str(given) in names()


def _pulled() -> Path:
    return cache_dir("models")


def pulled_path(name: str) -> Path:
    """Where a model of this name lies once it is pulled."""
    return _pulled() / name
