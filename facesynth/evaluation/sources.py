"""Where the motion of each row of a comparison comes from: stored predictions, or recordings; as it is, or with lips closed.

Lips are closed at p, b and m by the same step for every row: as near as they come in the median of what the row's fold
learned from. Who closes them himself gains little by it; who does not shows what of his closures that step alone would give.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from facesynth.corpus import Corpus
from facesynth.evaluation.contestants import CLOSED, SAME_WORDS, SECOND_TAKE
from facesynth.evaluation.folds import Fold
from facesynth.evaluation.lips import closure_threshold, require_parting
from facesynth.evaluation.pair import UnavailableError
from facesynth.evaluation.predictions import load_prediction
from facesynth.evaluation.same_words import SaidWord, said_words, same_words
from facesynth.evaluation.second_take import retimed, second_take
from facesynth.inference.closures import close_at
from facesynth.inference.errors import FacesynthError
from facesynth.inference.lips import bilabial_spans, has_lips, narrowest_gaps
from facesynth.inference.motion import Motion
from facesynth.inference.speech import PhoneTrack
from facesynth.progress import track

FEWEST_REPEATED = 0.5
"""Of the tested utterances so many must have all their words in other sentences, or there is no row of the same words."""


@dataclass(frozen=True, eq=False)
class Sources:
    """What motions are read from."""

    predictions: Path
    """Folder that holds a folder for each method."""
    words: Mapping[str, Sequence[SaidWord]] = field(default_factory=dict)
    """Of every recording, by its id; none where no row of the same words is wanted."""
    nearest: Mapping[str, float] = field(default_factory=dict)
    """By tested utterance: the gap that closed lips come to; none where no rows with closed lips are wanted."""

    def motion(self, corpus: Corpus, label: str, utterance_id: str) -> Motion | None:
        """Of a row, of an utterance; None where there is none."""
        if label.endswith(CLOSED):
            plain = self.motion(corpus, label.removesuffix(CLOSED), utterance_id)
            phones = corpus[utterance_id].speech.phones
            return None if plain is None else closed(plain, phones, self.nearest[utterance_id])
        if label == SECOND_TAKE:
            take = second_take(corpus, utterance_id)
            return retimed(take, corpus[utterance_id].speech.phones) if take else None
        if label == SAME_WORDS:
            return self._said_again(corpus, utterance_id)
        path = self.predictions / label / f"{utterance_id}.npz"
        return stored_motion(path, utterance_id, corpus) if path.is_file() else None

    def _said_again(self, corpus: Corpus, utterance_id: str) -> Motion | None:
        others = [word for words in self._words_beside(corpus, utterance_id) for word in words]
        try:
            return same_words(corpus[utterance_id], list(self.words[utterance_id]), corpus, others)
        except UnavailableError:
            return None

    def _words_beside(self, corpus: Corpus, utterance_id: str) -> Iterator[Sequence[SaidWord]]:
        """Of the recordings of other sentences in the same emotion."""
        this = corpus.record(utterance_id)
        for name, words in self.words.items():
            record = corpus.record(name)
            if record.sentence_key != this.sentence_key and record.emotion == this.emotion:
                yield words


def closed(motion: Motion, phones: PhoneTrack, nearest: float) -> Motion:
    """The motion with lips as near to each other as `nearest` (unit of the layout) at each p, b and m."""
    spans = bilabial_spans(phones, motion.fps)
    frames = close_at(motion.frames.astype(np.float64), motion.layout, spans, nearest, motion.fps)
    return replace(motion, frames=frames.astype(np.float32))


def nearest_gaps(corpus: Corpus, folds: Sequence[Fold]) -> dict[str, float]:
    """By tested utterance: the median of the narrowest gaps at p, b and m in what its fold learns from.

    FacesynthError where no step can close lips, or where shut lips tell nothing.
    """
    if not has_lips(corpus.layout):
        raise FacesynthError("--closed wants pairs of inner-lip points, which this layout does not name; leave it out")
    found: dict[str, float] = {}
    for fold in track(folds, "lips of the recordings", len(folds)):
        recorded = list(corpus.subset(fold.train))
        try:
            threshold = closure_threshold((one.motion, one.speech.phones) for one in recorded)
            require_parting((one.motion for one in recorded), threshold)
        except UnavailableError as reason:
            raise FacesynthError(f"--closed: {reason}; leave it out") from None
        spans = ((one.motion.frames, bilabial_spans(one.speech.phones, one.motion.fps)) for one in recorded)
        gaps = [gap for frames, some in spans for gap in narrowest_gaps(frames, corpus.layout, some)]
        found |= dict.fromkeys(fold.test, float(np.nanmedian(gaps)))
    return found


def repeated_words(corpus: Corpus, tested: Sequence[str]) -> tuple[dict[str, list[SaidWord]], str]:
    """The words of all recordings where the corpus repeats them, and else nothing and the reason why there is no such row."""
    words = {name: said_words(corpus, name) for name in track(corpus.ids, "words", len(corpus))}
    sentences: dict[tuple[str, str], set[str]] = {}
    for name, said in words.items():
        record = corpus.record(name)
        for word in said:
            sentences.setdefault((record.emotion, word.word), set()).add(record.sentence_key)
    whole = sum(
        bool(words[name]) and all(len(sentences[corpus.record(name).emotion, word.word]) > 1 for word in words[name])
        for name in tested
    )
    if whole < FEWEST_REPEATED * len(tested):
        told = f"{whole} of {len(tested)} tested utterances have all their words in other sentences too"
        return {}, f"No row “{SAME_WORDS}”: {told}."
    return words, ""


def stored_motion(path: Path, utterance_id: str, corpus: Corpus) -> Motion:
    """Of the same points, so that the corpus alone says which of them are the lips: a prediction's groups do not count."""
    named, motion = load_prediction(path, corpus.layout)
    if named != utterance_id:
        raise FacesynthError(f"{path} says that it is utterance {named!r}; its name says {utterance_id!r}: rename one")
    mine, wanted = motion.layout, corpus.layout
    return replace(motion, layout=wanted) if (mine.kind, mine.names) == (wanted.kind, wanted.names) else motion
