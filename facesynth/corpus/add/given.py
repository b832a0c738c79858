"""What was given of a recording: its files and what is said of it, so that adding it again tells what has changed."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from facesynth.corpus.add.recordings import Recording
from facesynth.corpus.record import Record, cell
from facesynth.hashing import hash_file

DIGITS = 16
"""Of a sha256, in hexadecimal: two things that a person might give never share them."""
FOLDER, GRID = "folder", "textgrid"
"""Not given, but kept as well: name of the folder that the recording came from, and the TextGrid as it was written."""
NAMES = {"text": "words", "transcriber": "words"}
"""What a part is called when a person is told of it."""


@dataclass(frozen=True)
class Given:
    """One recording, as it is given this time."""

    recording: Recording
    id: str
    facts: Mapping[str, Any]
    """Fields of `Record` that somebody stated; what nobody stated this time is not among them."""
    face: int | None = None

    def prints(self) -> dict[str, str]:
        """A short hash of each part that is given."""
        recording = self.recording
        files = {"sound": recording.sound, "motion": recording.motion, "phones": recording.phones, "emotions": recording.emotions}
        prints = {part: hash_file(path)[:DIGITS] for part, path in files.items() if path is not None}
        if recording.phones is not None and recording.speaker is not None:
            prints["phones"] = _short(f"{prints['phones']} {recording.speaker}")
        facts = {name: cell(value) for name, value in self.facts.items()}
        facts |= {"face": str(self.face)} if self.face is not None else {}
        if recording.transcriber is not None and recording.phones is None and "text" not in facts:
            facts["transcriber"] = str(recording.transcriber.resolve())
        facts[FOLDER] = recording.motion.resolve().parent.name
        return prints | {name: _short(value) for name, value in facts.items()}

    def files(self) -> tuple[Path, ...]:
        """Every file that belongs to the recording."""
        found = (self.recording.sound, self.recording.motion, self.recording.phones, self.recording.text, self.recording.emotions)
        return tuple(dict.fromkeys(path for path in found if path is not None))


def changes(given: Given, prints: Mapping[str, str], old: Record) -> frozenset[str]:
    """Parts that are given otherwise than before; what was never given before is compared with what the corpus says.

    Who writes down the words counts where there are none.
    """
    before = read_prints(old.given)
    new = {part for part in prints if part != FOLDER and before.get(part) != prints[part]}
    same = {part for part in new - set(before) if part in given.facts and getattr(old, part) == given.facts[part]}
    return frozenset(new - same - ({"transcriber"} if old.text else set()))


def read_prints(given: str) -> dict[str, str]:
    """The hashes of a cell `part:hash part:hash …`."""
    return dict(entry.split(":", 1) for entry in given.split() if ":" in entry)


def write_prints(prints: Mapping[str, str]) -> str:
    """The cell that `read_prints` reads."""
    return " ".join(f"{part}:{prints[part]}" for part in sorted(prints))


def in_words(parts: frozenset[str]) -> tuple[str, ...]:
    """Parts as a person would call them."""
    return tuple(sorted(NAMES.get(part, part) for part in parts))


def _short(value: str) -> str:
    return hashlib.sha256(value.encode()).hexdigest()[:DIGITS]
