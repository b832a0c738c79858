"""What a corpus is still too small for."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import product

from facesynth.corpus.checks.problem import Problem
from facesynth.corpus.files import Files
from facesynth.corpus.record import Record
from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import PHONES, SILENCE
from facesynth.speech.textgrid import read_textgrid

FEWEST_OF_AN_EMOTION = 10
"""Recordings of an emotion that its recognition must have heard."""
RARE = frozenset({SILENCE, "ax", "el", "em", "en", "zh"})


@dataclass(frozen=True)
class Need:
    """What a method should have to learn from; rules of thumb."""

    method: str
    minutes: float
    """Of speech."""
    of_each_phone: int = 0
    """Recordings of each phone in each emotion."""


def lacking(files: Files, records: Iterable[Record], needs: Sequence[Need]) -> Iterator[Problem]:
    """Notes on methods for which there is too little to learn from, and on emotions that are too rare."""
    minutes, counts, takes, unknown = 0.0, defaultdict[str, Counter[str]](Counter), Counter[str](), list[str]()
    for record in records:
        if not record.usable:
            continue
        with suppress(FacesynthError, OSError):
            phones, _ = read_textgrid(files.phones(record.id))
            minutes += phones.duration_s / 60
            takes[record.emotion] += 1
            if phones.known:
                counts[record.emotion].update(phones.labels)
            else:
                unknown.append(record.id)
    if not takes:
        return
    short = [f"{need.method} ({need.minutes:g})" for need in needs if minutes < need.minutes]
    if short:
        do = "record more; `facesynth corpus stats` says which sentences would add most"
        yield Problem("utterances.csv", f"{minutes:.1f} minutes are little for {', '.join(short)}", do, grave=False)
    if unknown:
        what = f"nobody knows what is said in {len(unknown)} recordings ({', '.join(unknown[:3])}{'…' * (len(unknown) > 3)})"
        do = "`facesynth corpus align` places phones; methods that hear the sound alone need none"
        yield Problem("phones", what, do, grave=False)
    for need, (emotion, heard) in product(needs, counts.items()):
        few = [phone for phone in PHONES if phone not in RARE and heard[phone] < need.of_each_phone]
        if few:
            what = f"{emotion}: too few for {need.method} (under {need.of_each_phone} times) are the phones {' '.join(few)}"
            yield Problem("phones", what, "record sentences with them (`facesynth corpus stats`)", grave=False)
    scarce = [f"{emotion} ({count})" for emotion, count in takes.items() if count < FEWEST_OF_AN_EMOTION]
    if len(takes) > 1 and scarce:
        what = f"too few recordings to tell an emotion by its sound: {', '.join(scarce)}"
        yield Problem("utterances.csv", what, f"record at least {FEWEST_OF_AN_EMOTION} of each", grave=False)
