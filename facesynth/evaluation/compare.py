"""Judging methods side by side: the same sentences to learn from, the same to be tested on, the same figures."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from filelock import FileLock, Timeout

from facesynth.corpus import Corpus
from facesynth.corpus.workers import ALONE, Workers, spread
from facesynth.evaluation.contestants import (
    CLOSED,
    SAME_WORDS,
    SECOND_TAKE,
    Contestant,
    Family,
    check_labels,
    is_recorded,
    references,
)
from facesynth.evaluation.curve import Curve, curves_of
from facesynth.evaluation.details import Details, residual_reach
from facesynth.evaluation.folds import Fold, check_folds, minutes_of, read_folds, rest_of, write_folds
from facesynth.evaluation.jobs import Job, read_account, run_job
from facesynth.evaluation.judge import APART, Judge, confusion_of, recogniser_of, shut_opening, sync_of
from facesynth.evaluation.metrics import METRICS
from facesynth.evaluation.paired import Difference, compare_pairs
from facesynth.evaluation.part_statistics import PART_COLUMNS
from facesynth.evaluation.second_take import second_take
from facesynth.evaluation.sources import Sources, nearest_gaps, repeated_words
from facesynth.evaluation.table import Column, Comparison, Row
from facesynth.evaluation.tallies import Task, refuse_strangers, tally
from facesynth.evaluation.variety import VARIETY
from facesynth.evaluation.versions import versions
from facesynth.inference.errors import FacesynthError
from facesynth.methods.capabilities import Part
from facesynth.methods.registry import capabilities_of
from facesynth.progress import track

FOLDS = "folds.json"
PREDICTIONS = "predictions"
MAIN = (
    "marker_error", "lve", "lve_centred", "lip_gap_corr", "closure_rate", "false_closure_rate", "energy_ratio",
    "sync_rate", "sync_offset", "two_sample", "diversity", "emotion_accuracy", "other_phones", "other_visemes",
    "head_cca", "head_distance", *(column.name for column in PART_COLUMNS),
    "train_s", "train_cpu_s", "rtf", "rtf_cpu", "model_mb",
)  # fmt: skip
"""Columns of the short table; everything is in the CSV and the JSON."""
OVERTAKEN = {"train_s": "train_cpu_s", "rtf": "rtf_cpu"}
"""Times by the clock stand in the short table only where nobody measured those of the processor: a clock tells as much of
what else the computer did."""
COSTS = (
    Column("train_s", "s", "low"),
    Column("train_cpu_s", "s", "low"),
    Column("train_minutes", "min"),
    Column("rtf", "1", "low"),
    Column("rtf_cpu", "1", "low"),
    Column("peak_mb", "MB", "low"),
    Column("model_mb", "MB", "low"),
)


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Everything that a comparison found; computed from recordings and stored predictions alone."""

    comparison: Comparison
    details: Mapping[str, Details]
    """By row label."""
    differences: tuple[Difference, ...]
    folds: tuple[Fold, ...]
    sources: Sources
    """What the motions of the rows are read from."""
    accounts: Mapping[str, Sequence[Mapping[str, Any]]]
    """By row label: what the predictions of each fold were made of; nothing for predictions made elsewhere."""
    remarks: tuple[str, ...] = ()
    """Why rows are not there."""

    @property
    def predictions(self) -> Path:
        """Folder that holds a folder for each method."""
        return self.sources.predictions

    def curves(self, families: Sequence[Family]) -> tuple[Curve, ...]:
        """Error against movement, a curve for each method and for each family that is one method."""
        return curves_of({label: one.trade for label, one in self.details.items()}, families)

    def warnings(self) -> list[str]:
        """What whoever reads the table must know of how its rows were made."""
        sources = {one.get("versions", {}).get("source") for made in self.accounts.values() for one in made}
        if len(sources) < 2:
            return list(self.remarks)
        return [
            *self.remarks,
            f"The rows were made by {len(sources)} versions of facesynth's source (see “Made of” on the page): "
            "rows of different ones differ by more than their settings.",
        ]

    def main_columns(self) -> list[str]:
        """Columns of the short table: those of `MAIN` that some method has."""
        scores = [score for label, score in self.comparison.scores.items() if not is_recorded(label)]
        known = [name for name in MAIN if any(name in row and row[name].utterances for row in scores)]
        return [name for name in known if OVERTAKEN.get(name) not in known]


def evaluate(
    contestants: Sequence[Contestant],
    corpus: Corpus,
    folds: Sequence[Fold],
    folder: str | Path,
    *,
    seed: int = 0,
    workers: Workers = ALONE,
    device: str = "cpu",
    closed: bool = False,
) -> Evaluation:
    """Train every contestant on every fold, let it speak the tested sentences, and judge what it made by the recordings.

    `folder` keeps folds and predictions; what it holds already, made of the same things, is not made again. closed: each row
    once more with the lips closed, see `sources`.
    """
    check_labels(contestants)
    check_folds(corpus, folds)
    folder = Path(folder)
    write_folds(folder / FOLDS, corpus, folds)
    predictions = folder / PREDICTIONS
    jobs = [
        Job(corpus.path, predictions, one, fold, number, seed, device)
        for number, fold in enumerate(folds, 1)
        for one in contestants
    ]
    with _alone_in(folder):
        for _ in spread(run_job, jobs, workers, "training and speaking"):
            pass
    labels = [one.label for one in contestants]
    return judge_predictions(corpus, folds, predictions, labels, seed=seed, workers=workers, closed=closed)


@contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """Two runs in one folder would take each other's half-made predictions away."""
    try:
        with FileLock(folder / ".lock", timeout=0):
            yield
    except Timeout:
        raise FacesynthError(f"another comparison is writing to {folder}; wait for it, or choose another folder") from None


def judge_predictions(
    corpus: Corpus,
    folds: Sequence[Fold],
    predictions: str | Path,
    labels: Sequence[str] | None = None,
    *,
    seed: int = 0,
    workers: Workers = ALONE,
    closed: bool = False,
) -> Evaluation:
    """Judge stored predictions, ours or anybody's, without training anything; `labels` are all that are there otherwise.

    closed: each row once more with the lips closed, see `sources`.
    """
    check_folds(corpus, folds)
    predictions = Path(predictions)
    labels = predicted_labels(predictions) if labels is None else list(labels)
    for label in labels:
        refuse_strangers(corpus, predictions / label)
    tested = corpus.subset(sorted(i for fold in folds for i in fold.test))
    judges = judges_of(corpus, folds, tested)
    reach = residual_reach(track(tested, "recorded movement", len(tested)))
    accounts = {label: _accounts(predictions / label, len(folds)) for label in labels}
    words, remark = repeated_words(corpus, tested.ids)
    sources = Sources(predictions, words, nearest_gaps(corpus, folds) if closed else {})
    parts = {label: _part(accounts.get(label, ())) for label in (SECOND_TAKE, *((SAME_WORDS,) if words else ()), *labels)}
    parts |= {label + CLOSED: part for label, part in parts.items() if closed and part not in APART}
    ordered = sorted(parts, key=lambda label: list(parts).index(label.removesuffix(CLOSED)))
    tasks = [Task(corpus.path, corpus.ids, sources, label, tested.ids, judges, reach, parts[label]) for label in ordered]
    judged = list(spread(tally, tasks, workers, "judging"))
    rows = [_with_costs(one.row, accounts.get(one.row.label, ()), one.costs) for one in judged]
    rows[0] = _explain_second_take(rows[0], corpus, tested)
    recorded = [pair for fold in folds for pair in judges[fold.test[0]].recorded(corpus.subset(fold.test))]
    comparison = Comparison(
        _columns(rows, tested),
        tested.ids,
        tuple(rows),
        seed,
        confusion_of(recorded),
        provenance(corpus, folds),
        tuple(corpus.record(i).sentence_key for i in tested.ids),
        tuple(corpus.record(i).emotion for i in tested.ids),
    )
    details = {one.row.label: one.details for one in judged}
    remarks = tuple(one for one in (remark, _without_closures(rows)) if one)
    return Evaluation(comparison, details, compare_pairs(comparison), tuple(folds), sources, accounts, remarks)


def _without_closures(rows: Sequence[Row]) -> str:
    """Why no method has a column of closures; nothing where one has, or where none moves the mouth."""
    mouths = [row for row in rows if not is_recorded(row.label) and np.isfinite(row.values.get("marker_error", ())).any()]
    if not mouths or any(np.isfinite(row.values["closure_rate"]).any() for row in mouths):
        return ""
    return f"No column of closures: {mouths[0].reasons['closure_rate']}."


def folds_beside(predictions: str | Path, corpus: Corpus) -> tuple[Fold, ...]:
    """The folds kept beside (or in) a folder of predictions; otherwise one fold that tests on whatever was predicted."""
    folder = Path(predictions)
    labels = predicted_labels(folder)
    for path in (folder / FOLDS, folder.parent / FOLDS):
        if path.is_file():
            return read_folds(path, corpus)
    predicted = {path.stem for label in labels for path in (folder / label).glob("*.npz")}
    fold = rest_of(corpus, predicted)
    check_folds(corpus, (fold,))
    return (fold,)


def predicted_labels(predictions: Path, families: Sequence[Family] = ()) -> list[str]:
    """Methods that have predictions in a folder: by name, then variants in the order of their families, then references."""
    if not predictions.is_dir():
        raise FacesynthError(f"{predictions}: no such folder; it should hold a folder of NPZ files for each method")
    labels = sorted(path.name for path in predictions.iterdir() if path.is_dir() and any(path.glob("*.npz")))
    if not [label for label in labels if not is_recorded(label)]:
        raise FacesynthError(f"{predictions} holds no predictions; wanted METHOD/UTTERANCE.npz in the documented form")
    ordered = [label for family in families for label in family.labels] + [one.label for one in references()]
    last = [label for label in dict.fromkeys(ordered) if label in labels]
    return [label for label in labels if not is_recorded(label) and label not in last] + last


def judges_of(corpus: Corpus, folds: Sequence[Fold], tested: Corpus) -> dict[str, Judge]:
    """By tested utterance: one threshold of closure for all, and a recogniser that learned from its fold's other sentences."""
    threshold = shut_opening(tested, (corpus.subset(fold.train) for fold in folds))
    judges: dict[str, Judge] = {}
    for fold in track(folds, "judges", len(folds)):
        train = corpus.subset(fold.train)
        judge = Judge(threshold, recogniser_of(train), sync_of(train))
        judges |= dict.fromkeys(fold.test, judge)
    return judges


def provenance(corpus: Corpus, folds: Sequence[Fold]) -> dict[str, object]:
    """What figures were made from: recordings with their hash, folds, versions."""
    tested = [i for fold in folds for i in fold.test]
    return {
        "corpus": corpus.provenance(),
        "notes": corpus.notes,
        "folds": len(folds),
        "learned_minutes": [round(minutes_of(corpus, fold.train), 2) for fold in folds],
        "tested_utterances": len(tested),
        "tested_sentences": len({corpus.record(i).sentence_key for i in tested}),
        "tested_minutes": round(minutes_of(corpus, tested), 2),
        "versions": versions(),
    }


def _explain_second_take(row: Row, corpus: Corpus, tested: Corpus) -> Row:
    reasons = {**row.reasons, **{column.name: "a recording costs nothing to compute" for column in COSTS}}
    if not any(second_take(corpus, utterance_id) for utterance_id in tested.ids):
        reasons |= {metric.name: "not available: no second recording of these sentences and emotions" for metric in METRICS}
    return replace(row, reasons=reasons)


def _accounts(folder: Path, count: int) -> list[dict[str, Any]]:
    return [account for number in range(1, count + 1) if (account := read_account(folder / f"fold-{number}.json"))]


def _part(accounts: Sequence[Mapping[str, Any]]) -> Part:
    """What a method moves; of predictions made elsewhere, a mouth that may move the rest too."""
    methods = {one["contestant"]["method"] for one in accounts if "contestant" in one}
    return capabilities_of(methods.pop()).part if methods else "mouth"


def _with_costs(row: Row, accounts: Sequence[Mapping[str, Any]], costs: Mapping[str, float]) -> Row:
    """Means over the folds; the largest for memory. Reasons say why predictions made elsewhere have none."""
    found = dict(costs)
    for name in ("train_s", "train_cpu_s", "train_minutes", "model_mb", "peak_mb"):
        known = [float(one[name]) for one in accounts if one.get(name) is not None]
        if known:
            found[name] = max(known) if name == "peak_mb" else sum(known) / len(known)
    missing = {column.name: "nobody kept it beside the predictions" for column in COSTS if column.name not in found}
    return replace(row, costs=found, reasons={**missing, **row.reasons})


def _columns(rows: Sequence[Row], tested: Corpus) -> tuple[Column, ...]:
    """Metrics, the emotion's, the joins', the methods' own figures in order of appearance, and the costs."""
    known = [Column(metric.name, metric.unit_in(tested.layout.unit), metric.best) for metric in METRICS]
    known.append(Column("emotion_accuracy", "1", "high"))
    known += [Column("sync_rate", "1", "high"), Column("sync_offset", "ms", "0"), Column("two_sample", "1", "low")]
    known += [Column(name, tested.layout.unit, "" if name == "diversity" else "low") for name in VARIETY]
    names = {column.name for column in known}
    own = list(dict.fromkeys(name for row in rows for name in row.values if name not in names))
    moved = [column for column in PART_COLUMNS if any(column.name in row.costs for row in rows if not is_recorded(row.label))]
    return (*known, *(Column(name, "1", "1" if name == "join_jump" else "") for name in own), *moved, *COSTS)
