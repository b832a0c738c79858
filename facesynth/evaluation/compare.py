"""Judging methods side by side: the same sentences to learn from, the same to be tested on, the same figures."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Protocol, runtime_checkable

from facesynth.corpus import Corpus
from facesynth.errors import FacesynthError
from facesynth.evaluation.cost import model_mb, peak_memory
from facesynth.evaluation.dynamics import join_jump
from facesynth.evaluation.judge import NAN, Judge, Tally
from facesynth.evaluation.metrics import METRICS
from facesynth.evaluation.pair import UnavailableError
from facesynth.evaluation.predictions import load_prediction, save_prediction
from facesynth.evaluation.second_take import retimed, second_take
from facesynth.evaluation.table import Column, Comparison, Row
from facesynth.methods.method import Method
from facesynth.motion.motion import Motion
from facesynth.progress import track
from facesynth.speech.speech import Speech

SECOND_TAKE = "second take"
COSTS = (
    Column("train_s", "s", "low"),
    Column("rtf", "1", "low"),
    Column("peak_mb", "MB", "low"),
    Column("model_mb", "MB", "low"),
)


@runtime_checkable
class Reporting(Protocol):
    """A method with figures of its own, averaged into columns of their own."""

    def report(self, speech: Speech) -> Mapping[str, float]:
        """Figures (1) of what it makes of a speech."""
        ...


@runtime_checkable
class Joining(Protocol):
    """A method that joins pieces of recorded motion."""

    def joins(self, speech: Speech) -> Sequence[int]:
        """First frames of the pieces that it joins for a speech, without frame 0."""
        ...


def reference_methods() -> dict[str, Callable[[], Method]]:
    """The rows that every table has beside the second take."""
    from facesynth.methods.baselines.mean_face import MeanFace
    from facesynth.methods.baselines.phone_mean import PhoneMean
    from facesynth.methods.baselines.ridge import Ridge
    from facesynth.methods.baselines.tcn import Tcn

    return {"mean face": MeanFace, "phone mean": PhoneMean, "ridge": Ridge, "tcn": Tcn}


def evaluate(
    methods: Mapping[str, Method | Callable[[], Method]],
    train: Corpus,
    test: Corpus,
    *,
    seed: int = 0,
    predictions_dir: str | Path,
) -> Comparison:
    """Train each method, let it say every utterance of `test`, and judge what it made by the recordings.

    A method that is trained already is taken as it is. Predictions are kept as `predictions_dir/LABEL/ID.npz` and
    figures are computed from what was kept. A second take of the test utterances is a row of its own.
    """
    _check(methods, train, test)
    judge = Judge.from_recordings(train, test)
    folder = Path(predictions_dir)
    rows = [_second_take_row(test, judge, folder / SECOND_TAKE)]
    for label, method in methods.items():
        trained, train_s = _trained(method, train, seed)
        rows.append(_row(label, trained, test, judge, folder / label, train_s=train_s, seed=seed))
    return Comparison(_columns(rows, test), test.ids, tuple(rows), seed, judge.recorded(test), _provenance(train, test))


def _row(label: str, method: Method, test: Corpus, judge: Judge, folder: Path, *, train_s: float, seed: int) -> Row:
    tally, synthesis_s, speech_s = Tally(judge), 0.0, 0.0
    with peak_memory() as peak:
        for utterance in track(test, f"{label}: speaking", len(test)):
            started = time.perf_counter()
            motion = method.synthesize(utterance.speech, seed=seed)
            synthesis_s, speech_s = synthesis_s + time.perf_counter() - started, speech_s + utterance.speech.duration_s
            save_prediction(folder / f"{utterance.id}.npz", utterance.id, motion)
    for utterance in track(test, f"{label}: judging", len(test)):
        motion = load_prediction(folder / f"{utterance.id}.npz")[1]
        tally.add(utterance, motion)
        _add_own_figures(tally, method, utterance.speech, motion)
    costs = {"train_s": train_s, "rtf": synthesis_s / speech_s, "peak_mb": peak.mb, "model_mb": model_mb(method)}
    tally.reasons |= {"train_s": "it was trained before", "peak_mb": "this system does not tell peak memory"}
    return tally.row(label, costs)


def _add_own_figures(tally: Tally, method: Method, speech: Speech, motion: Motion) -> None:
    if isinstance(method, Joining):
        try:
            tally.set("join_jump", join_jump(motion, method.joins(speech)))
        except UnavailableError as reason:
            tally.set("join_jump", NAN, str(reason))
    if isinstance(method, Reporting):
        for name, value in method.report(speech).items():
            tally.set(name, value)


def _second_take_row(test: Corpus, judge: Judge, folder: Path) -> Row:
    tally = Tally(judge)
    for utterance in track(test, f"{SECOND_TAKE}: judging", len(test)):
        take = second_take(test, utterance.id)
        if take is None:
            tally.miss("not available: no second recording of these sentences and emotions")
            continue
        save_prediction(folder / f"{utterance.id}.npz", utterance.id, retimed(take, utterance.speech.phones))
        tally.add(utterance, load_prediction(folder / f"{utterance.id}.npz")[1])
    tally.reasons |= {column.name: "a recording costs nothing to compute" for column in COSTS}
    return tally.row(SECOND_TAKE, {})


def _trained(method: Method | Callable[[], Method], train: Corpus, seed: int) -> tuple[Method, float]:
    """A trained method, and how long that took (s); NaN where it came trained."""
    made = method if isinstance(method, Method) else method()
    if made.layout is not None:
        return made, NAN
    started = time.perf_counter()
    return made.fit(train, seed=seed), time.perf_counter() - started


def _columns(rows: Sequence[Row], test: Corpus) -> tuple[Column, ...]:
    """Metrics, the emotion's, the joins', the methods' own figures in order of appearance, and the costs."""
    known = [Column(metric.name, metric.unit_in(test.layout.unit), metric.best) for metric in METRICS]
    known.append(Column("emotion_accuracy", "1", "high"))
    names = {column.name for column in known}
    own = list(dict.fromkeys(name for row in rows for name in row.values if name not in names))
    return (*known, *(Column(name, "1", "1" if name == "join_jump" else "") for name in own), *COSTS)


def _provenance(train: Corpus, test: Corpus) -> dict[str, object]:
    return {"train": train.provenance(), "test": test.provenance()}


def _check(methods: Mapping[str, object], train: Corpus, test: Corpus) -> None:
    for label in methods:
        if label == SECOND_TAKE or not re.fullmatch(r"\w[\w .+=-]*", label):
            raise FacesynthError(f"{label!r} cannot be a method's label, which names a folder; use letters, digits and spaces")
    if not len(test):
        raise FacesynthError("there is no usable utterance to test on; record more, or split otherwise")
    both = {r.sentence_key for r in train.usable_records} & {r.sentence_key for r in test.usable_records}
    if both:
        raise FacesynthError(f"sentence {sorted(both)[0]!r} is learned from and tested on; split the corpus by sentence")
