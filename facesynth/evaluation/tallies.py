"""Judging all stored predictions of one method."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from facesynth.corpus import Corpus, Utterance
from facesynth.errors import FacesynthError
from facesynth.evaluation.details import Details, DetailSums
from facesynth.evaluation.dynamics import join_jump
from facesynth.evaluation.judge import NAN, Judge, Tally
from facesynth.evaluation.pair import UnavailableError
from facesynth.evaluation.predictions import Beside, load_prediction, read_beside
from facesynth.evaluation.table import Row
from facesynth.motion.motion import Motion


@dataclass(frozen=True, eq=False)
class Task:
    """One method to judge."""

    corpus: Path
    predictions: Path
    label: str
    tested: tuple[str, ...]
    judges: Mapping[str, Judge]
    """By utterance."""
    reach: float
    """Of the residual histogram, see `residual_reach`."""


@dataclass(frozen=True, eq=False)
class Judged:
    """What was found of one method."""

    row: Row
    details: Details
    costs: Mapping[str, float]


def tally(task: Task) -> Judged:
    """Every figure of every tested utterance; an utterance without a prediction has none, and the reason says so."""
    corpus, folder = Corpus.open(task.corpus), task.predictions / task.label
    figures, sums = Tally(), DetailSums(task.reach)
    synthesis_s = speech_s = 0.0
    for utterance_id in task.tested:
        path = folder / f"{utterance_id}.npz"
        if not path.is_file():
            figures.miss(f"{task.label} has no prediction of some utterances")
            continue
        utterance, motion = corpus[utterance_id], _motion(path, utterance_id, corpus)
        figures.add(task.judges[utterance_id], utterance, motion)
        sums.add(utterance, motion)
        if beside := read_beside(path):
            _add_own(figures, beside, motion)
            synthesis_s, speech_s = synthesis_s + beside.synthesis_s, speech_s + beside.speech_s
    costs = {"rtf": synthesis_s / speech_s} if speech_s else {}
    return Judged(figures.row(task.label, {}), sums.details(), costs)


def read_pair(corpus: Corpus, predictions: Path, label: str, utterance_id: str) -> tuple[Utterance, Motion] | None:
    """An utterance and a method's prediction of it; None where there is none."""
    path = predictions / label / f"{utterance_id}.npz"
    return (corpus[utterance_id], _motion(path, utterance_id, corpus)) if path.is_file() else None


def _motion(path: Path, utterance_id: str, corpus: Corpus) -> Motion:
    named, motion = load_prediction(path, corpus.layout)
    if named != utterance_id:
        raise FacesynthError(f"{path} says that it is utterance {named!r}; its name says {utterance_id!r}: rename one")
    return motion


def refuse_strangers(corpus: Corpus, folder: Path) -> None:
    """FacesynthError where a folder holds predictions of utterances that the corpus lacks."""
    for path in folder.glob("*.npz"):
        if not path.name.startswith(".") and path.stem not in corpus:
            raise FacesynthError(
                f"{path}: the corpus has no utterance {path.stem!r}; predictions are called METHOD/UTTERANCE.npz"
            )


def _add_own(figures: Tally, beside: Beside, motion: Motion) -> None:
    if beside.joins is not None:
        try:
            figures.set("join_jump", join_jump(motion, beside.joins))
        except UnavailableError as reason:
            figures.set("join_jump", NAN, str(reason))
    for name, value in beside.own.items():
        figures.set(name, value)
