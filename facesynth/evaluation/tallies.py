"""Judging all stored predictions of one method."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from facesynth.corpus import Corpus, Utterance
from facesynth.evaluation.contestants import is_recorded
from facesynth.evaluation.details import Details, DetailSums
from facesynth.evaluation.dynamics import join_jump
from facesynth.evaluation.judge import APART, NAN, Judge, Tally, moves_alone
from facesynth.evaluation.pair import UnavailableError
from facesynth.evaluation.part_statistics import PART_COLUMNS, PartSums
from facesynth.evaluation.predictions import Beside, read_beside, sample_paths
from facesynth.evaluation.sources import Sources, stored_motion
from facesynth.evaluation.table import Row
from facesynth.evaluation.two_sample import two_sample
from facesynth.evaluation.variety import VARIETY
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion
from facesynth.methods.capabilities import Part


@dataclass(frozen=True, eq=False)
class Task:
    """One method to judge."""

    corpus: Path
    known: tuple[str, ...]
    """Utterances of the corpus that there are: those left out are no second takes either."""
    sources: Sources
    label: str
    tested: tuple[str, ...]
    judges: Mapping[str, Judge]
    """By utterance."""
    reach: float
    """Of the residual histogram, see `residual_reach`."""
    part: Part = "mouth"
    """What the method moves."""


@dataclass(frozen=True, eq=False)
class Judged:
    """What was found of one method."""

    row: Row
    details: Details
    costs: Mapping[str, float]


def tally(task: Task) -> Judged:
    """Every figure of every tested utterance; an utterance without a prediction has none, and the reason says so."""
    corpus, spent = Corpus.open(task.corpus).subset(task.known), list[Beside]()
    figures, sums, parts, motions = Tally(), DetailSums(task.reach), PartSums(), dict[str, Motion]()
    for utterance_id in task.tested:
        motion = task.sources.motion(corpus, task.label, utterance_id)
        if motion is None:
            figures.miss(f"{task.label} has no prediction of some utterances")
            continue
        utterance, motions[utterance_id] = corpus[utterance_id], motion
        figures.add(task.judges[utterance_id], utterance, motion, task.part)
        parts.add(utterance, motion, task.part)
        if task.part not in APART:
            sums.add(utterance, motion)
        if is_recorded(task.label):
            continue
        path = task.sources.predictions / task.label / f"{utterance_id}.npz"
        if task.part not in APART:
            _add_variety(figures, path, motion, utterance, corpus)
        if beside := read_beside(path):
            _add_own(figures, beside, motion)
            spent.append(beside)
    if task.part not in APART:
        _add_two_sample(figures, task, corpus, motions)
    figures.explain(VARIETY, "no other motion of the same speech: the method draws none, or none lies beside the predictions")
    moved = parts.figures()
    alone = moves_alone(task.part) if task.part in APART else "the method moves neither head nor eyes, or nobody recorded them"
    figures.reasons |= {column.name: alone for column in PART_COLUMNS if column.name not in moved}
    return Judged(figures.row(task.label, {}), sums.details(), _rates(spent) | moved)


def refuse_strangers(corpus: Corpus, folder: Path) -> None:
    """FacesynthError where a folder holds predictions of utterances that the corpus lacks."""
    for path in folder.glob("*.npz"):
        if not path.name.startswith(".") and path.stem not in corpus:
            raise FacesynthError(
                f"{path}: the corpus has no utterance {path.stem!r}; predictions are called METHOD/UTTERANCE.npz"
            )


def _rates(spent: Sequence[Beside]) -> dict[str, float]:
    """Real-time factors by the clock and by the processor, as far as they are known."""
    speech_s = sum(one.speech_s for one in spent)
    processor_s = [one.synthesis_cpu_s for one in spent if one.synthesis_cpu_s is not None]
    found = {"rtf": sum(one.synthesis_s for one in spent) / speech_s} if speech_s else {}
    return found | ({"rtf_cpu": sum(processor_s) / speech_s} if speech_s and len(processor_s) == len(spent) else {})


def _add_variety(figures: Tally, path: Path, motion: Motion, utterance: Utterance, corpus: Corpus) -> None:
    samples = [motion, *(stored_motion(one, utterance.id, corpus) for one in sample_paths(path))]
    if len(samples) < 2:
        return
    for name in VARIETY:
        try:
            figures.set(name, VARIETY[name](samples, utterance.motion))
        except UnavailableError as reason:
            figures.set(name, NAN, str(reason))


def _add_two_sample(figures: Tally, task: Task, corpus: Corpus, motions: Mapping[str, Motion]) -> None:
    """How well a classifier tells this method's lips from recorded ones, utterance by utterance."""
    shapes = next((judge.sync.shapes for judge in task.judges.values() if judge.sync is not None), None)
    if shapes is None:
        return
    try:
        told = two_sample(shapes, motions, {utterance_id: corpus[utterance_id].motion for utterance_id in motions})
    except UnavailableError as reason:
        figures.explain(["two_sample"], str(reason))
        return
    figures.values["two_sample"] = [told.get(utterance_id, NAN) for utterance_id in task.tested]


def _add_own(figures: Tally, beside: Beside, motion: Motion) -> None:
    if beside.joins is not None:
        try:
            figures.set("join_jump", join_jump(motion, beside.joins))
        except UnavailableError as reason:
            figures.set("join_jump", NAN, str(reason))
    for name, value in beside.own.items():
        figures.set(name, value)
