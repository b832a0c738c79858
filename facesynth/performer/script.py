"""What the built-in performer says: 225 English sentences, ordered so that every beginning of the list is worth recording."""

from dataclasses import dataclass
from importlib.resources import files
from typing import Literal

from facesynth.inference.errors import unknown

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
