"""Which sentences would add most to a corpus: those with pairs of phones that it has never, or hardly ever, recorded."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from facesynth.corpus.corpus import Corpus
from facesynth.corpus.record import plain_words
from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import SILENCE
from facesynth.speech.pronunciation import pronounce
from facesynth.speech.textgrid import read_textgrid
from facesynth.speech.transcript import words_of

Diphone = tuple[str, str]


@dataclass(frozen=True)
class Addition:
    """A sentence worth recording."""

    text: str
    new: int
    """Different pairs of phones in it that neither the corpus nor the sentences before it hold."""
    phones: int


def sentences_to_add(corpus: Corpus, candidates: Iterable[str], count: int = 10) -> tuple[Addition, ...]:
    """The best `count` of candidates, greedily: each the one that adds most for its length to what is there by then.

    A pair of phones that was recorded n times is worth 1 / (1 + n), so that rare ones count as well as new ones.
    """
    known = diphones(corpus)
    said = {plain_words(record.text) for record in corpus.usable_records}
    phones = {text: _phones(text) for text in dict.fromkeys(candidates) if plain_words(text) not in said}
    left = {text: labels for text, labels in phones.items() if len(labels) > 2}
    chosen: list[Addition] = []
    while left and len(chosen) < count:
        best = max(left, key=lambda text: _worth(left[text], known))
        labels = left.pop(best)
        pairs = Counter(pairwise(labels))
        chosen.append(Addition(best, sum(pair not in known for pair in pairs), len(labels) - 2))
        known.update(pairs)
    return tuple(chosen)


def diphones(corpus: Corpus) -> Counter[Diphone]:
    """How often each pair of successive phones was recorded, silence included."""
    counted = Counter[Diphone]()
    for record in corpus.usable_records:
        counted.update(pairwise(read_textgrid(corpus.files.phones(record.id))[0].labels))
    return counted


def read_sentences(path: Path) -> tuple[str, ...]:
    """Sentences from a text file, one a line; lines that begin with # are remarks."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise FacesynthError(f"{path} cannot be read as text in UTF-8 ({error})") from None
    found = tuple(" ".join(line.split()) for line in lines if line.strip() and not line.startswith("#"))
    if not found:
        raise FacesynthError(f"{path} holds no sentences; write one a line")
    return found


def _phones(text: str) -> list[str]:
    return [SILENCE, *(phone for word in words_of(text) for phone in pronounce(word)), SILENCE]


def _worth(labels: Sequence[str], known: Counter[Diphone]) -> float:
    return sum(1 / (1 + known[pair]) for pair in set(pairwise(labels))) / len(labels)
