"""The performer's own words, said again in other recordings: how near he comes to himself where no sentence was recorded twice.

Each word of a sentence is taken from another recording that says it between the same two words, or beside one of them, or
anywhere, of these the one that lasts most nearly as long, and stretched phone by phone. Pauses go with the word before them.
Words are cut together and not smoothed.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus import Corpus, Utterance
from facesynth.evaluation.pair import UnavailableError
from facesynth.evaluation.second_take import Span, matching_times, sampled, spans
from facesynth.inference.motion import Motion
from facesynth.inference.speech import PhoneTrack
from facesynth.speech.textgrid import read_textgrid


@dataclass(frozen=True)
class SaidWord:
    """A word of a recording."""

    utterance: str
    before: str
    word: str
    after: str
    start_s: float
    end_s: float

    def likeness(self, other: Self) -> tuple[int, float]:
        """How many neighbours are the same, and how little the durations differ; the larger the better."""
        apart_s = abs((self.end_s - self.start_s) - (other.end_s - other.start_s))
        return (self.before == other.before) + (self.after == other.after), -apart_s


def said_words(corpus: Corpus, utterance_id: str) -> list[SaidWord]:
    """Words of an utterance as its TextGrid has them, in lower case; "" beside the first and the last."""
    words = read_textgrid(corpus.files.phones(utterance_id))[1]
    labels = ["", *(label.lower() for label, _, _ in words), ""]
    between = zip(labels[:-2], labels[1:-1], labels[2:], words, strict=True)
    return [SaidWord(utterance_id, before, word, after, start, end) for before, word, after, (_, start, end) in between]


def same_words(
    utterance: Utterance, words: list[SaidWord], recorded: Mapping[str, Utterance] | Corpus, others: list[SaidWord]
) -> Motion:
    """The motion of an utterance put together from other recordings of its words.

    words: of the utterance; others: of the recordings that may be taken from. UnavailableError where one is in none of them.
    """
    fps, phones = utterance.motion.fps, utterance.speech.phones
    if not words:
        raise UnavailableError(f"{utterance.id} has no words beside its phones")
    edges = [0, *(round(word.start_s * fps) for word in words[1:]), int(phones.frame_bounds(fps)[-1])]
    pieces = [
        _piece(recorded, _likest(word, others), np.arange(start, stop) / fps, _phones_of(phones, word), word)
        for word, start, stop in zip(words, edges[:-1], edges[1:], strict=True)
    ]
    return Motion(np.concatenate(pieces), fps, utterance.motion.layout)


def _likest(word: SaidWord, others: list[SaidWord]) -> SaidWord:
    same = [other for other in others if other.word == word.word and other.utterance != word.utterance]
    if not same:
        raise UnavailableError(f"no other recording says {word.word!r}")
    return max(same, key=word.likeness)


def _piece(
    recorded: Mapping[str, Utterance] | Corpus, taken: SaidWord, times_s: NDArray[np.float64], phones: list[Span], word: SaidWord
) -> NDArray[np.float32]:
    """[t, C] the frames of another recording at what stands there for times [t] here."""
    other = recorded[taken.utterance]
    here, there = matching_times(phones, _phones_of(other.speech.phones, taken))
    beside_s = np.minimum(times_s - here[0], 0) + np.maximum(times_s - here[-1], 0)  # pauses are as long as they are
    at = (np.interp(times_s, here, there) + beside_s) * other.motion.fps
    return sampled(other.motion.frames, np.clip(at, 0, len(other.motion) - 1))


def _phones_of(phones: PhoneTrack, word: SaidWord) -> list[Span]:
    """The phones of which most lies in a word; the word as a whole where there are none."""
    inside = [span for span in spans(phones) if word.start_s <= (span[1] + span[2]) / 2 <= word.end_s]
    return inside or [("", word.start_s, word.end_s)]
