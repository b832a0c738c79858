"""Search of the cost's parameters on sentences that are not in the database (Deng 2006, §5.3.6).

The error is piecewise constant in the parameters (the path changes or it does not), so there is no
gradient: a tree-structured Parzen estimator (Optuna) over the logarithms of PNT and of the six weights, begun
with the published ones. Trials are asked for in groups, so that what is found does not depend on the number of
processes. Every evaluation is kept in a file; a search that was interrupted and is started again with the same
seed asks for the same trials, takes from there what is done and goes on.
"""

import json
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import optuna
import torch
from tqdm import tqdm

from facesynth.corpus import Corpus, Record, Utterance
from facesynth.inference.arrays import Floats
from facesynth.inference.errors import FacesynthError
from facesynth.methods.efase.method import Efase
from facesynth.motion.resample import resample

RANGES: dict[str, tuple[float, float]] = {
    "penalty": (5.0, 100.0),
    "alpha": (0.3, 30.0),
    "beta": (0.05, 50.0),
    "eta": (0.05, 50.0),
    "gamma": (0.03, 1.0),
    "delta": (0.03, 3.0),
    "phi": (0.01, 1.0),
}
"""Where each setting of eFASE is looked for; all are searched by their logarithm."""
PUBLISHED = {"alpha": 3.6052, "beta": 5.7814, "eta": 6.8282, "gamma": 0.2903, "delta": 0.315, "phi": 0.109, "penalty": 10.0}
"""Deng 2006; PNT is ours, the dissertation gives none."""
CROWD = 4
"""Trials of a group for each setting."""


@dataclass(frozen=True, eq=False)
class Example:
    """A sentence to imitate, in the model's coordinates."""

    utterance: Utterance
    truth: Floats
    """[T, D] at the database's rate; NaN where the recording has a gap."""


@dataclass(frozen=True)
class Tuning:
    """What a search found."""

    settings: dict[str, float]
    error: float
    """On the tuning sentences, mean over sentences, squared unit of the layout."""
    evaluations: int
    tuning_sentences: tuple[str, ...]
    test_sentences: tuple[str, ...]
    test_error: float
    published_test_error: float


def split_for_tuning(corpus: Corpus, tuning: int, test: int, seed: int) -> tuple[Corpus, Corpus, Corpus]:
    """(database, tuning, test): utterances of disjoint sentences, evenly over the emotions."""
    chosen: list[list[str]] = [[], []]
    taken: set[str] = set()
    order = np.random.default_rng(seed).permutation(len(corpus.usable_records))
    for place, count in enumerate((tuning, test)):
        for number in range(count):
            emotion = corpus.emotions[number % len(corpus.emotions)]
            fresh = [r for r in _in_order(corpus, order) if r.sentence_key not in taken]
            record = next((r for r in fresh if r.emotion == emotion), None) or next(iter(fresh), None)
            if record is None:
                raise FacesynthError(
                    f"{tuning} + {test} sentences were asked for; the corpus has only {len(taken)} different ones"
                )
            taken.add(record.sentence_key)
            chosen[place].append(record.id)
    rest = [r.id for r in corpus.usable_records if r.sentence_key not in taken]
    return corpus.subset(rest), corpus.subset(chosen[0]), corpus.subset(chosen[1])


def tune(
    model: Efase, tuning: Corpus, test: Corpus, *, journal: str | Path, generations: int = 10, seed: int = 0, workers: int = 1
) -> Tuning:
    """Find settings for a model whose database holds neither `tuning` nor `test`.

    `generations` groups of CROWD × 7 trials follow the first one, which is drawn at random but for the published settings.
    journal: a file of JSON lines, one for each evaluation, which makes the search resumable; it belongs to one model and seed.
    """
    kept = _Journal(Path(journal), {"seed": seed, "corpus": model.provenance.get("sha256"), "sentences": list(tuning.ids)})
    group = CROWD * len(RANGES)
    study = _study(seed, group)
    with TemporaryDirectory() as folder, _Workers(model, tuning, kept, workers, group * (generations + 1), Path(folder)) as pool:
        for _ in range(generations + 1):
            trials = [study.ask() for _ in range(group)]
            settings = [{name: trial.suggest_float(name, *RANGES[name], log=True) for name in RANGES} for trial in trials]
            for trial, error in zip(trials, pool.errors_of(settings), strict=True):
                study.tell(trial, error)
    examples = examples_of(model, test)
    return Tuning(
        study.best_params,
        float(study.best_value),
        len(study.trials),
        tuple(tuning.ids),
        tuple(test.ids),
        mean_error(model.with_weights(**study.best_params), examples),
        mean_error(model.with_weights(**PUBLISHED), examples),
    )


def _study(seed: int, group: int) -> optuna.Study:
    """A search that begins with the published settings; Optuna tells of a study only what goes wrong."""
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(sampler=optuna.samplers.TPESampler(n_startup_trials=group, seed=seed))
    study.enqueue_trial(PUBLISHED)
    return study


def tuned(
    corpus: Corpus,
    *,
    journal: Path,
    sentences: int,
    test_sentences: int,
    generations: int,
    limit: int | None = None,
    seed: int = 0,
    workers: int = 1,
) -> Tuning:
    """`tune` on held-out sentences of a corpus; the database is all others, or `limit` utterances, evenly chosen."""
    database, tuning, test = split_for_tuning(corpus, sentences, test_sentences, seed)
    if limit and len(database) > limit:
        database = database.subset([database.ids[i * len(database) // limit] for i in range(limit)])
    model = Efase().fit(database, seed=seed)
    return tune(model, tuning, test, journal=journal, generations=generations, seed=seed, workers=workers)


def examples_of(model: Efase, corpus: Corpus) -> list[Example]:
    """The utterances of a corpus, ready to be compared with."""
    fps = model.config["database_fps"]
    motions = [(utterance, resample(utterance.motion, fps)) for utterance in corpus]
    return [Example(u, model.pca.encode(torch.from_numpy(m.frames)).numpy().astype(np.float64)) for u, m in motions]


def mean_error(model: Efase, examples: Iterable[Example]) -> float:
    """Mean over sentences of eq. 13 of Deng 2008, in PCA space, where squared distances are those over markers."""
    speaker, points = model.speaker, len(model.fitted_layout.names)
    errors = []
    for example in examples:
        speech = example.utterance.speech
        feelings, _ = speech.emotions.per_phone(speech.phones)
        bounds = speech.phones.frame_bounds(speaker.database_fps)
        made = speaker.coordinates(speaker.plan(speech), speech.phones.labels, feelings, bounds)
        count = min(len(made), len(example.truth))
        errors.append(np.nanmean(((made[:count] - example.truth[:count]) ** 2).sum(axis=1)) / points)
    return float(np.mean(errors))


def _in_order(corpus: Corpus, order: np.ndarray) -> Iterator[Record]:
    return (corpus.usable_records[i] for i in order)


class _Journal:
    """Errors by settings, in a file that only grows."""

    def __init__(self, path: Path, about: dict[str, Any]) -> None:
        self.path, self.errors = path, dict[str, float]()
        if path.exists():
            text = path.read_text(encoding="utf-8", errors="replace")
            lines = text.splitlines()
            if not lines or _complete(lines[0]) != about:
                raise FacesynthError(f"{path} belongs to another search, or to none; give another file, or remove it")
            self.errors = {row["key"]: row["error"] for row in map(_complete, lines[1:]) if {"key", "error"} <= row.keys()}
            if not text.endswith("\n"):  # an interruption cut the last line
                with path.open("a", encoding="utf-8") as file:
                    file.write("\n")
        else:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(json.dumps(about) + "\n", encoding="utf-8")

    def keep(self, key: str, error: float) -> None:
        self.errors[key] = error
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps({"key": key, "error": error}) + "\n")


def _complete(line: str) -> dict[str, Any]:
    """A line of the journal, or nothing for one that an interruption cut."""
    try:
        row = json.loads(line)
    except ValueError:
        return {}
    return row if isinstance(row, dict) else {}


class _Workers:
    """Evaluates populations, in processes where more than one is wanted; the result does not depend on their number."""

    def __init__(self, model: Efase, corpus: Corpus, journal: _Journal, workers: int, total: int, folder: Path) -> None:
        self.model, self.corpus, self.journal, self.workers, self.folder = model, corpus, journal, workers, folder
        self.bar = tqdm(total=total, desc="tuning", disable=None, leave=False)
        self.examples = examples_of(model, corpus) if workers == 1 else []
        self.pool: ProcessPoolExecutor | None = None

    def __enter__(self) -> "_Workers":
        if self.workers > 1:
            path = self.folder / "model.safetensors"
            self.model.save(path)
            arguments = (str(path), str(self.corpus.path), self.corpus.ids)
            self.pool = ProcessPoolExecutor(self.workers, get_context("spawn"), _start_worker, arguments)
        return self

    def __exit__(self, *_: object) -> None:
        self.bar.close()
        if self.pool:
            self.pool.shutdown(cancel_futures=True)

    def errors_of(self, settings: Sequence[dict[str, float]]) -> list[float]:
        """One for each; what the journal knows is not computed again."""
        keys = [json.dumps([round(float(np.log(one[name])), 12) for name in RANGES]) for one in settings]
        missing = [i for i, key in enumerate(keys) if key not in self.journal.errors]
        jobs = [settings[i] for i in missing]
        errors = self.pool.map(_work, jobs) if self.pool else (self._error(job) for job in jobs)
        for i, error in zip(missing, errors, strict=True):
            self.journal.keep(keys[i], error)
            self.bar.update()
        return [self.journal.errors[key] for key in keys]

    def _error(self, settings: dict[str, float]) -> float:
        return mean_error(self.model.with_weights(**settings), self.examples)


_WORKER: dict[str, Any] = {}


def _start_worker(model_path: str, corpus_path: str, ids: tuple[str, ...]) -> None:
    torch.set_num_threads(1)
    model = Efase.load(model_path)
    _WORKER["model"] = model
    _WORKER["examples"] = examples_of(model, Corpus.open(corpus_path).subset(ids))


def _work(settings: dict[str, float]) -> float:
    return mean_error(_WORKER["model"].with_weights(**settings), _WORKER["examples"])
