"""What judges the motion of one method: the recordings, and figures utterance by utterance."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from facesynth.corpus import Corpus, Utterance
from facesynth.evaluation.emotion_recognition import Confusion, EmotionRecogniser
from facesynth.evaluation.folds import some_of
from facesynth.evaluation.lips import closure_threshold, require_parting
from facesynth.evaluation.metrics import METRICS, Case
from facesynth.evaluation.pair import UnavailableError
from facesynth.evaluation.sync import NEVER_MOVES, SyncJudge, in_step
from facesynth.evaluation.table import Row
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion
from facesynth.methods.capabilities import Part

NAN = float("nan")
MOST_LEARNED, MOST_HEARD = 400, 100
"""Utterances are enough to tell emotions apart, and to tell what is in step."""
APART: tuple[Part, ...] = ("head", "eyes")
"""Parts that are moved alone: the face rests meanwhile, and is not judged."""


@dataclass(frozen=True)
class Judge:
    """What the recordings must tell before a motion can be judged."""

    closure_threshold: float
    """Opening that counts as shut, unit of the layout; NaN where nobody says p, b or m."""
    recogniser: EmotionRecogniser | None
    """None where the training recordings have a single emotion."""
    sync: SyncJudge | None = None
    """None where the training recordings are too few, or of no lips."""

    def figures(self, utterance: Utterance, motion: Motion, part: Part = "mouth") -> Iterator[tuple[str, float, str]]:
        """(metric, value, reason why it is NaN) of one utterance; part: what the method moves, a mouth moving the others too."""
        case = Case(motion, utterance.motion, utterance.speech.phones, self.closure_threshold)
        for metric in METRICS:
            if part in APART and metric.part != part:
                yield metric.name, NAN, moves_alone(part)
                continue
            try:
                yield metric.name, metric.measure(case), ""
            except UnavailableError as reason:
                yield metric.name, NAN, str(reason)

    def recorded(self, test: Corpus) -> list[tuple[str, str]]:
        """(emotion, what the recogniser takes it for) of the recordings themselves."""
        if self.recogniser is None:
            return []
        whole = [u for u in test if not np.isnan(u.motion.frames).any(axis=1).all()]
        return [(u.emotion, self.recogniser.recognise(u.motion)) for u in whole]


def moves_alone(part: Part) -> str:
    """Why a figure is missing."""
    return f"the method moves the {part} alone"


def shut_opening(test: Corpus, learned: Iterable[Corpus]) -> float:
    """Opening that counts as shut, from what is tested, for methods that learned from those recordings, of each fold.

    NaN where nobody says p, b or m, or where a face that holds the mean pose, of what is tested or of what was learned from,
    would be shut all the time: closures say nothing there.
    """
    try:
        threshold = closure_threshold((utterance.motion, utterance.speech.phones) for utterance in test)
        for some in (test, *(train.subset(some_of(train.ids, MOST_LEARNED, 0)) for train in learned if train.ids)):
            require_parting((utterance.motion for utterance in some), threshold)
    except UnavailableError:
        return NAN
    return threshold


def recogniser_of(train: Corpus) -> EmotionRecogniser | None:
    """A recogniser that learned from at most `MOST_LEARNED` utterances; None for a single emotion."""
    if len({record.emotion for record in train.usable_records}) < 2:
        return None
    return EmotionRecogniser.fit(train.subset(some_of(train.ids, MOST_LEARNED, 0)))


def sync_of(train: Corpus) -> SyncJudge | None:
    """What learned, from at most `MOST_HEARD` utterances, whether lips go with a sound; None where they teach too little."""
    try:
        return SyncJudge.learn(train.subset(some_of(train.ids, MOST_HEARD, 0)))
    except UnavailableError:
        return None


def confusion_of(pairs: Sequence[tuple[str, str]]) -> Confusion | None:
    """The confusion matrix of (asked, recognised) pairs; None where there are none."""
    return Confusion.of(*zip(*pairs, strict=True)) if pairs else None


class Tally:
    """Figures of one method, utterance by utterance."""

    def __init__(self) -> None:
        self.values: dict[str, list[float]] = {}
        self.reasons: dict[str, str] = {}
        self.emotions: list[tuple[str, str]] = []
        self.shifts_ms: dict[int, float] = {}
        self.count = 0

    def add(self, judge: Judge, utterance: Utterance, motion: Motion, part: Part = "mouth") -> None:
        """Judge one utterance of a method that moves a part."""
        self.count += 1
        try:
            for name, value, reason in judge.figures(utterance, motion, part):
                self.set(name, value, reason)
        except FacesynthError as error:
            raise FacesynthError(f"utterance {utterance.id!r} cannot be judged: {error}") from None
        if part in APART:
            self.set("emotion_accuracy", NAN, moves_alone(part))
        else:
            self._add_emotion(judge, utterance.emotion, motion)
            self._add_sync(judge, utterance, motion)

    def miss(self, reason: str) -> None:
        """Count an utterance for which there is no motion."""
        self.count += 1
        for metric in METRICS:
            self.set(metric.name, NAN, reason)
        self.set("emotion_accuracy", NAN, reason)

    def set(self, name: str, value: float, reason: str = "") -> None:
        """The figure `name` of the newest utterance; earlier ones that lack it are NaN."""
        column = self.values.setdefault(name, [])
        column += [NAN] * (self.count - 1 - len(column)) + [value]
        if reason:
            self.reasons.setdefault(name, reason)

    def explain(self, names: Iterable[str], reason: str) -> None:
        """Why figures that no utterance has are missing."""
        for name in names:
            if name not in self.values:
                self.reasons.setdefault(name, reason)

    def row(self, label: str, costs: Mapping[str, float]) -> Row:
        """The method's row."""
        columns = self.values | self._sync()
        values = {name: tuple(column + [NAN] * (self.count - len(column))) for name, column in columns.items()}
        return Row(label, values, costs, self.reasons, confusion_of(self.emotions))

    def _add_sync(self, judge: Judge, utterance: Utterance, motion: Motion) -> None:
        if judge.sync is None:
            return
        try:
            self.shifts_ms[self.count - 1] = judge.sync.shift_ms(utterance.speech, motion)
        except UnavailableError as reason:
            self.reasons.setdefault("sync_rate", str(reason))

    def _sync(self) -> dict[str, list[float]]:
        """How often the lips are in step, and how late they are."""
        if not self.shifts_ms:
            return {}
        found = in_step([self.shifts_ms.get(number) for number in range(self.count)])
        if np.isnan(found).all():
            self.explain(("sync_rate", "sync_offset"), NEVER_MOVES)
            return {}
        return {"sync_rate": found.tolist(), "sync_offset": [self.shifts_ms.get(number, NAN) for number in range(self.count)]}

    def _add_emotion(self, judge: Judge, asked: str, motion: Motion) -> None:
        if judge.recogniser is None:
            self.set("emotion_accuracy", NAN, "the recordings to learn from show a single emotion")
            return
        recognised = judge.recogniser.recognise(motion)
        self.emotions.append((asked, recognised))
        self.set("emotion_accuracy", float(asked == recognised))
