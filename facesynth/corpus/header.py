"""corpus.yaml: what holds for every utterance of a corpus."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from facesynth.atomic import write_text
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout

FORMAT = 1
"""Version of the folder's format; a corpus of another version is refused."""


@dataclass(frozen=True)
class Header:
    """What holds for every utterance of a corpus."""

    performer: str
    layout: Layout
    fps: float
    """Rate of the motion, Hz."""
    emotions: tuple[str, ...]
    synthetic: bool = False
    """Whether nobody was recorded: voice and face are computed."""
    licence: str = ""
    """Of recordings that state none of their own."""
    consent: str = ""
    notes: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "emotions", tuple(self.emotions))
        if not self.performer.strip():
            raise FacesynthError("a corpus needs the performer's name; got an empty one")
        if not (1 <= self.fps <= 1000):
            raise FacesynthError(f"fps must lie between 1 and 1000; got {self.fps}")
        if not self.emotions or len(set(self.emotions)) != len(self.emotions) or not all(self.emotions):
            raise FacesynthError(f"a corpus needs a list of different emotions, at least one; got {list(self.emotions)}")
        for emotion in self.emotions:
            if emotion != emotion.lower() or any(c.isspace() or c == "," for c in emotion):
                raise FacesynthError(f"emotion {emotion!r} must be one word in lower case, without commas")


def read_header(path: Path) -> Header:
    """Read corpus.yaml; FacesynthError for a folder that is no corpus, or one of another version."""
    if not path.is_file():
        raise no_corpus(path.parent)
    try:
        plain = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise FacesynthError(f"{path} is not readable as YAML: {' '.join(str(error).split())}") from None
    if not isinstance(plain, dict) or plain.get("format") != FORMAT:
        got = plain.get("format") if isinstance(plain, dict) else None
        raise FacesynthError(f"{path} states corpus format {got}; this facesynth reads format {FORMAT}")
    if lacking := [name for name in ("performer", "layout", "fps", "emotions") if name not in plain]:
        raise FacesynthError(f"{path}: {lacking[0]!r} is missing")
    if not isinstance(plain["emotions"], list):
        raise FacesynthError(f"{path}: emotions must be a list; got {plain['emotions']!r}")
    try:
        return _header(plain)
    except (ValueError, TypeError) as error:  # a FacesynthError, or fps that is no number
        raise FacesynthError(f"{path}: {error}") from None


def no_corpus(folder: Path) -> FacesynthError:
    """The error for a folder that is no corpus."""
    return FacesynthError(f"{folder} is no corpus (it has no corpus.yaml); make one with `facesynth corpus new`")


def write_header(path: Path, header: Header) -> None:
    """Write corpus.yaml, atomically."""
    plain = {
        "format": FORMAT,
        "performer": header.performer,
        "synthetic": header.synthetic,
        "fps": header.fps,
        "emotions": list(header.emotions),
        "licence": header.licence,
        "consent": header.consent,
        "notes": header.notes,
        "layout": _plain(header.layout.to_dict()),
    }
    write_text(path, yaml.safe_dump(plain, sort_keys=False, allow_unicode=True, default_flow_style=None, width=120))


def _plain(value: Any) -> Any:
    """NumPy's numbers, which a layout computed elsewhere may hold, as Python's."""
    if isinstance(value, dict):
        return {name: _plain(item) for name, item in value.items()}
    if isinstance(value, list):
        return [_plain(item) for item in value]
    return value.item() if isinstance(value, np.generic) else value


def _header(plain: dict[str, Any]) -> Header:
    return Header(
        performer=str(plain["performer"]),
        layout=Layout.from_dict(plain["layout"]),
        fps=float(plain["fps"]),
        emotions=tuple(map(str, plain["emotions"])),
        synthetic=bool(plain.get("synthetic", False)),
        **{name: str(plain.get(name) or "") for name in ("licence", "consent", "notes")},
    )
