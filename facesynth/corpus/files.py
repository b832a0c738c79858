"""Where the files of an utterance lie, and which names are safe to make files of.

A corpus may come from a stranger: an id must never lead out of the corpus' folder, on any system.
"""

import re
import unicodedata
from dataclasses import dataclass
from pathlib import Path

from facesynth.inference.errors import FacesynthError

_FORBIDDEN = re.compile(r'[\x00-\x1f\x7f<>:"/\\|?*]')
_WINDOWS_DEVICES = {"con", "prn", "aux", "nul", *(f"{port}{n}" for port in ("com", "lpt") for n in range(1, 10))}
_LONGEST_BYTES = 200


def check_id(utterance_id: str) -> str:
    """The id itself, if files on every system may be called so; FacesynthError otherwise."""
    fault = _fault(utterance_id)
    if fault:
        raise FacesynthError(f"utterance id {utterance_id!r} {fault}; use letters, digits, '-' and '_'")
    return utterance_id


def _fault(name: str) -> str:
    if not name:
        return "is empty"
    if found := _FORBIDDEN.search(name):
        return f"holds {found.group()!r}, which file names cannot hold everywhere"
    if name[0] in ".+ " or name[-1] in ". ":
        return "starts with '.', '+' or a space, or ends with '.' or a space"
    if name.split(".", maxsplit=1)[0].casefold() in _WINDOWS_DEVICES:
        return "is the name of a device on Windows"
    if len(name.encode()) > _LONGEST_BYTES:
        return f"is longer than {_LONGEST_BYTES} bytes"
    return "" if unicodedata.is_normalized("NFC", name) else "is not in Unicode's composed form (NFC)"


@dataclass(frozen=True)
class Files:
    """The files of one corpus folder."""

    root: Path

    @property
    def header(self) -> Path:
        """corpus.yaml"""
        return self.root / "corpus.yaml"

    @property
    def records(self) -> Path:
        """utterances.csv"""
        return self._inside(self.root / "utterances.csv")

    @property
    def journal(self) -> Path:
        """edits.jsonl"""
        return self._inside(self.root / "edits.jsonl")

    @property
    def lock(self) -> Path:
        """Held by whoever writes."""
        return self._inside(self.root / ".lock")

    def audio(self, utterance_id: str) -> Path:
        """audio/ID.wav"""
        return self._of("audio", utterance_id, ".wav")

    def phones(self, utterance_id: str) -> Path:
        """phones/ID.TextGrid"""
        return self._of("phones", utterance_id, ".TextGrid")

    def motion(self, utterance_id: str) -> Path:
        """motion/ID.npz"""
        return self._of("motion", utterance_id, ".npz")

    def emotions(self, utterance_id: str) -> Path:
        """emotions/ID.csv, which exists where emotion moves within the utterance."""
        return self._of("emotions", utterance_id, ".csv")

    def _of(self, folder: str, utterance_id: str, suffix: str) -> Path:
        return self._inside(self.root / folder / (check_id(utterance_id) + suffix))

    def _inside(self, path: Path) -> Path:
        """The path, unless a link leads it out of the corpus."""
        if not path.resolve().is_relative_to(self.root.resolve()):
            raise FacesynthError(f"{path} is a link that leads out of the corpus {self.root}; copy the file into the corpus")
        return path
