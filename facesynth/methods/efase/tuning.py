"""Search of the cost's parameters on sentences that are not in the database (Deng 2006, §5.3.6), of one corpus or of several.

The error is piecewise constant in the parameters (the path changes or it does not), so there is no
gradient: a tree-structured Parzen estimator (Optuna) over the logarithms of PNT and of the six weights, begun
with those that the models have and the published ones, each also with a high price of another emotion. What is found on one
performer need not suit another, so several corpora are searched together. Of each the error counts relative to that of the
models' own settings: their geometric mean is made least, and what is lost on any corpus weighs LOSS times as much. What is
HOPELESS on one corpus is not tried on the next, so the cheapest corpus is best named first.

Trials are asked for in groups, so that what is found does not depend on who evaluates them. Every evaluation is
kept in a file; a search that was interrupted and is started again with the same seed asks for the same trials, takes
from there what is done and goes on.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import optuna

from facesynth.corpus import Corpus, Record
from facesynth.corpus.workers import ALONE, Workers, spread
from facesynth.inference.errors import FacesynthError
from facesynth.methods.efase.method import Efase
from facesynth.methods.efase.tuning_journal import TuningJournal
from facesynth.methods.efase.tuning_search import ChangingSettings, Example, examples_of, sentence_errors

RANGES: dict[str, tuple[float, float]] = {
    "penalty": (1.0, 100.0),
    "alpha": (0.3, 30.0),
    "beta": (0.05, 50.0),
    "eta": (0.05, 50.0),
    "gamma": (0.03, 1.0),
    "delta": (0.03, 10.0),
    "phi": (0.01, 10.0),
}
"""Where each setting of the search is looked for; all are searched by their logarithm."""
SOFT_RANGES: dict[str, tuple[float, float]] = {
    "temperature": (0.03, 10.0),
    "audio_weight": (0.03, 30.0),
    "pose_weight": (0.03, 30.0),
    "expected_share": (0.1, 0.9),
}
"""The same of what the paper leaves at 0; searched where a model has it."""
APART = 1.0
"""A price of another emotion, phi, at which it costs as much as a step that no rule likes."""
PUBLISHED = {"alpha": 3.6052, "beta": 5.7814, "eta": 6.8282, "gamma": 0.2903, "delta": 0.315, "phi": 0.109, "penalty": 10.0}
"""Deng 2006; PNT is ours, the dissertation gives none."""
LOSS = 10.0
"""A loss of a hundredth on one corpus outweighs a gain of a tenth over all."""
HOPELESS = 1.03
"""A ratio of errors on one corpus for which no gain on others makes up."""
CROWD = 4
"""Trials of a group for each setting."""


@dataclass(frozen=True)
class Recordings:
    """A corpus with a model of it that knows neither the sentences to tune on nor those to test on; as files, for any process."""

    corpus: Path
    performer: str
    model: Path
    tuning: tuple[str, ...]
    test: tuple[str, ...]


@dataclass(frozen=True)
class Job:
    """One evaluation: some settings on some sentences of one corpus."""

    settings: tuple[tuple[str, float], ...]
    """Names and values; none: the model's own."""
    of: Recordings
    ids: tuple[str, ...]


@dataclass(frozen=True)
class ErrorsOnOthers:
    """Mean errors of one corpus on sentences that nothing was chosen by, squared unit of its layout."""

    performer: str
    test_sentences: tuple[str, ...]
    found: float
    default: float
    published: float
    nearer: int
    """Test sentences that the found settings are nearer in than the default ones."""
    farther: int


@dataclass(frozen=True)
class Tuning:
    """What a search found."""

    settings: dict[str, float]
    ratios: dict[str, float]
    """On the tuning sentences: error over that of the models' own settings, by performer."""
    evaluations: int
    tuning_sentences: tuple[tuple[str, ...], ...]
    """Of each corpus."""
    tested: tuple[ErrorsOnOthers, ...]
    """Of each corpus."""


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


def tuned(
    corpora: Sequence[Corpus],
    *,
    journal: Path,
    sentences: int,
    test_sentences: int,
    generations: int,
    limit: int | None = None,
    settings: Mapping[str, Any] | None = None,
    seed: int = 0,
    workers: Workers = ALONE,
) -> Tuning:
    """`tune` on held-out sentences of each corpus; a database is all others of it, or `limit` utterances, evenly chosen.

    settings: of `Efase`, where they are not its defaults; what they learn is left out, for it would choose the weights itself.
    """
    with _models(corpora, sentences, test_sentences, limit, dict(settings or {}), seed, journal) as recordings:
        return tune(recordings, journal=journal, generations=generations, seed=seed, workers=workers)


def tune(
    recordings: Sequence[Recordings], *, journal: str | Path, generations: int = 10, seed: int = 0, workers: Workers = ALONE
) -> Tuning:
    """Find settings that are nearest over all `recordings`.

    `generations` groups of trials, CROWD for each setting, follow the first one, which is drawn at random but for the
    models' own and the published settings. journal: a file of JSON lines, one for each evaluation, which makes the search
    resumable; it belongs to these models and this seed.
    """
    model = _loaded(recordings[0].model)
    ranges, kept = _ranges(model), TuningJournal(Path(journal), _about(recordings, seed))
    own = {name: float(model.config[name]) for name in ranges}
    start = [_errors(of, [own], kept, workers, f"the models' own settings, {of.performer}")[0] for of in recordings]
    study = _study(seed, CROWD * len(ranges), _within(ranges, own))
    for group in range(generations + 1):
        trials = [study.ask() for _ in range(CROWD * len(ranges))]
        settings = [{name: trial.suggest_float(name, *ranges[name], log=True) for name in ranges} for trial in trials]
        rows = _ratios(recordings, settings, start, kept, workers, f"tuning, group {group + 1} of {generations + 1}")
        for trial, ratios in zip(trials, rows, strict=True):
            study.tell(trial, standing(ratios))
    found = study.best_params
    best = _ratios(recordings, [found], start, kept, workers, "what was found")[0]
    return Tuning(
        found,
        {of.performer: ratio for of, ratio in zip(recordings, best, strict=False)},
        len(study.trials),
        tuple(one.tuning for one in recordings),
        tuple(_tested(recordings, found, workers)),
    )


def standing(ratios: Sequence[float]) -> float:
    """What the search makes least: the mean of the logarithms, and LOSS times the largest of them where that is a loss."""
    logs = np.log(ratios)
    return float(logs.mean() + LOSS * max(logs.max(), 0.0))


def _ratios(
    recordings: Sequence[Recordings],
    settings: Sequence[Mapping[str, float]],
    start: Sequence[float],
    kept: TuningJournal,
    workers: Workers,
    what: str,
) -> list[list[float]]:
    """Of each of the settings, errors over those of the `start` by corpus, up to the first on which they are HOPELESS."""
    ratios: list[list[float]] = [[] for _ in settings]
    for of, least in zip(recordings, start, strict=True):
        going = [number for number, row in enumerate(ratios) if max(row, default=1.0) <= HOPELESS]
        errors = _errors(of, [settings[number] for number in going], kept, workers, f"{what}, {of.performer}")
        for number, error in zip(going, errors, strict=True):
            ratios[number].append(error / least)
    return ratios


def _study(seed: int, group: int, own: Mapping[str, float]) -> optuna.Study:
    """A search that begins with what is known, and with that where emotions are kept apart; it tells only what goes wrong."""
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(sampler=optuna.samplers.TPESampler(n_startup_trials=group, seed=seed))
    for known in (own, PUBLISHED):
        study.enqueue_trial(dict(known))
        study.enqueue_trial({**known, "phi": APART})
    return study


def _within(ranges: Mapping[str, tuple[float, float]], settings: Mapping[str, float]) -> dict[str, float]:
    return {name: float(np.clip(settings[name], *limits)) for name, limits in ranges.items()}


def _ranges(model: Efase) -> dict[str, tuple[float, float]]:
    return RANGES | {name: limits for name, limits in SOFT_RANGES.items() if model.config[name] > 0}


def _about(recordings: Sequence[Recordings], seed: int) -> dict[str, Any]:
    """What evaluations depend on beside the settings that are tried."""
    models = [_loaded(one.model) for one in recordings]
    return {
        "seed": seed,
        "corpora": [model.provenance.get("sha256") for model in models],
        "models": [{key: value for key, value in model.config.items() if key not in RANGES} for model in models],
        "sentences": [list(one.tuning) for one in recordings],
    }


def _errors(
    of: Recordings, settings: Sequence[Mapping[str, float]], kept: TuningJournal, workers: Workers, what: str
) -> list[float]:
    """The mean error on a corpus of each of the settings; what the journal knows is not computed again."""
    rows = [tuple(one.items()) for one in settings]
    missing = [row for row in dict.fromkeys(rows) if not kept.knows(row, of.performer)]
    jobs = [Job(row, of, of.tuning) for row in missing]
    for row, errors in zip(missing, spread(errors_of, jobs, workers, what), strict=True):
        kept.keep(row, of.performer, float(np.mean(errors)))
    return [kept.error(row, of.performer) for row in rows]


def _tested(recordings: Sequence[Recordings], found: Mapping[str, float], workers: Workers) -> Iterator[ErrorsOnOthers]:
    rows = (tuple(found.items()), (), tuple(PUBLISHED.items()))
    jobs = [Job(row, of, of.test) for of in recordings for row in rows]
    errors = list(spread(errors_of, jobs, workers, "test sentences"))
    for number, of in enumerate(recordings):
        mine, default, published = (np.array(row) for row in errors[3 * number : 3 * number + 3])
        found_mean, default_mean, published_mean = (float(row.mean()) for row in (mine, default, published))
        nearer, farther = int((mine < default).sum()), int((mine > default).sum())
        yield ErrorsOnOthers(of.performer, of.test, found_mean, default_mean, published_mean, nearer, farther)


@contextmanager
def _models(
    corpora: Sequence[Corpus], tuning: int, test: int, limit: int | None, settings: dict[str, Any], seed: int, journal: Path
) -> Iterator[list[Recordings]]:
    """A model of each corpus, beside the journal: where other machines see the journal, they see the models."""
    names = [corpus.performer for corpus in corpora]
    if len(set(names)) < len(names):
        raise FacesynthError(f"each corpus must be of another performer; got {', '.join(names)}")
    journal.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=journal.parent, prefix="models-") as folder:
        recordings = []
        for number, corpus in enumerate(corpora):
            database, *held_out = split_for_tuning(corpus, tuning, test, seed)
            model = Efase.from_config({**settings, "learn": False, "maps": False, "residual": 0.0, "sharpening": 0.0})
            path = Path(folder) / f"{number}.safetensors"
            model.fit(some_of(database, limit), seed=seed).save(path)
            recordings.append(Recordings(corpus.path, corpus.performer, path, *(tuple(part.ids) for part in held_out)))
        yield recordings


def some_of(corpus: Corpus, limit: int | None) -> Corpus:
    """At most so many utterances, evenly chosen."""
    if not limit or len(corpus) <= limit:
        return corpus
    return corpus.subset([corpus.ids[i * len(corpus) // limit] for i in range(limit)])


def _in_order(corpus: Corpus, order: np.ndarray) -> Iterator[Record]:
    return (corpus.usable_records[i] for i in order)


@lru_cache(maxsize=8)
def _loaded(model: Path) -> Efase:
    return Efase.load(model)


@lru_cache(maxsize=8)
def _changing(model: Path) -> ChangingSettings:
    return ChangingSettings(_loaded(model))


@lru_cache(maxsize=16)
def _examples(of: Recordings, ids: tuple[str, ...]) -> list[Example]:
    return examples_of(_loaded(of.model), Corpus.open(of.corpus).subset(ids))


def errors_of(job: Job) -> list[float]:
    """The error of each sentence of a job, by a model and recordings that a process reads once."""
    return sentence_errors(_changing(job.of.model).speaker(dict(job.settings)), _examples(job.of, job.ids))
