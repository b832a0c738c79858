"""What a corpus is still too small for."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from contextlib import suppress

from facesynth.corpus.checks.problem import Problem
from facesynth.corpus.files import Files
from facesynth.corpus.record import Record
from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import PHONES, SILENCE
from facesynth.speech.textgrid import read_textgrid

MINUTES = {"ridge": 1.0, "lds": 1.0, "tcn": 3.0, "anime_graph": 3.0, "efase": 5.0}
"""Rules of thumb: minutes of speech that a method should have."""
FEWEST_OF_A_PHONE = 5
"""Recordings of one phone in one emotion under which a search has no choice."""
FEWEST_OF_AN_EMOTION = 10
"""Recordings of an emotion that its recognition must have heard."""
RARE = frozenset({SILENCE, "ax", "el", "em", "en", "zh"})


def lacking(files: Files, records: Iterable[Record]) -> Iterator[Problem]:
    """Notes on methods for which there is too little to learn from."""
    minutes, counts, takes = 0.0, defaultdict[str, Counter[str]](Counter), Counter[str]()
    for record in records:
        if not record.usable:
            continue
        with suppress(FacesynthError, OSError):
            phones, _ = read_textgrid(files.phones(record.id))
            minutes += phones.duration_s / 60
            counts[record.emotion].update(phones.labels)
            takes[record.emotion] += 1
    if not takes:
        return
    short = [f"{method} ({wanted:g})" for method, wanted in MINUTES.items() if minutes < wanted]
    if short:
        do = "record more; `facesynth corpus stats` says which sentences would add most"
        yield Problem("utterances.csv", f"{minutes:.1f} minutes are little for {', '.join(short)}", do, grave=False)
    for emotion, heard in counts.items():
        few = [phone for phone in PHONES if phone not in RARE and heard[phone] < FEWEST_OF_A_PHONE]
        if few:
            what = f"{emotion}: too few for efase (under {FEWEST_OF_A_PHONE} times) are the phones {' '.join(few)}"
            yield Problem("phones", what, "record sentences with them (`facesynth corpus stats`)", grave=False)
    scarce = [f"{emotion} ({count})" for emotion, count in takes.items() if count < FEWEST_OF_AN_EMOTION]
    if len(takes) > 1 and scarce:
        what = f"too few recordings to tell an emotion by its sound: {', '.join(scarce)}"
        yield Problem("utterances.csv", what, f"record at least {FEWEST_OF_AN_EMOTION} of each", grave=False)
