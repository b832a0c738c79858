"""One method on one fold: train, speak the tested sentences, keep what came out. Killed at any moment, it goes on there."""

import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from facesynth.atomic import write_text
from facesynth.corpus import Corpus, Utterance
from facesynth.device import device_of
from facesynth.evaluation.contestants import Contestant
from facesynth.evaluation.cost import MB, peak_speaking_mb, stopwatch
from facesynth.evaluation.folds import Fold, minutes_of, some_minutes, some_of
from facesynth.evaluation.predictions import (
    Beside,
    load_prediction,
    read_beside,
    sample_path,
    sample_paths,
    save_prediction,
    write_beside,
)
from facesynth.evaluation.versions import versions
from facesynth.inference.errors import FacesynthError
from facesynth.methods.method import Method
from facesynth.methods.registry import create, load

STORED = 2
"""Version of what is kept with predictions; older ones are made anew."""
SAMPLES, SAMPLED = 10, 20
"""A method that draws makes so many motions of each of so many of a fold's utterances."""
WARM_UTTERANCES = 6
BRIEF: Mapping[str, Any] = {"steps": 1, "learn": False, "pose_weight": 0.0, "expected_share": 0.0}
"""Settings with which a method that has them learns briefly: not even the network of a search that expects poses."""
_warm: set[str] = set()
"""Methods that this process has trained and heard before."""


@dataclass(frozen=True)
class Job:
    """One method on one fold."""

    corpus: Path
    predictions: Path
    """Folder that holds a folder for each method."""
    contestant: Contestant
    fold: Fold
    number: int
    """Of the fold, from 1."""
    seed: int
    device: str = "cpu"
    """Where it learns and speaks; see `facesynth.device.DEVICES`."""

    @property
    def folder(self) -> Path:
        """Where predictions are kept."""
        return self.predictions / self.contestant.label

    @property
    def account(self) -> Path:
        """JSON: what the predictions of this fold were made of, and what they cost."""
        return self.folder / f"fold-{self.number}.json"

    @property
    def model(self) -> Path:
        """The trained model while the fold is not finished."""
        return self.folder / f".fold-{self.number}.safetensors"

    def made_of(self, corpus: Corpus) -> str:
        """sha256 of all that decides the predictions: method, settings, seed, recordings."""
        learned, tested = (corpus.subset(ids).provenance()["sha256"] for ids in (self.learned(corpus), self.fold.test))
        facts = [STORED, self.contestant.plain(), self.seed, learned, tested]
        return sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()

    def learned(self, corpus: Corpus) -> tuple[str, ...]:
        """Ids of the utterances to learn from."""
        minutes = self.contestant.minutes
        return self.fold.train if minutes is None else some_minutes(corpus, self.fold.train, minutes, self.seed)


def run_job(job: Job) -> str:
    """Do what is not done yet; returns the label.

    One thread, whatever else runs: sums of floating-point numbers depend on how many threads share them, and figures
    must not depend on the number of workers.
    """
    import torch

    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        with threadpool_limits(1):
            _run(job, Corpus.open(job.corpus))
    except FacesynthError as error:
        raise FacesynthError(f"{job.contestant.label}, fold {job.number}: {error}") from None
    finally:
        torch.set_num_threads(before)
    return job.contestant.label


def _run(job: Job, corpus: Corpus) -> None:
    made_of, account = job.made_of(corpus), read_account(job.account)
    if account.get("made_of") != made_of:
        _forget(job, account)
        account = {"made_of": made_of, "contestant": job.contestant.plain(), "seed": job.seed, "versions": versions()}
    if account.get("done"):
        return
    if not job.model.is_file():
        account |= _train(job, corpus)
        _write(job.account, account)
    method = load(job.model).to(device_of(job.device))
    _speak(job, corpus, method)
    _sample(job, corpus, method)
    _write(job.account, account | {"peak_mb": _peak_mb(job, corpus), "done": True})
    job.model.unlink()


def _train(job: Job, corpus: Corpus) -> dict[str, Any]:
    learned = job.learned(corpus)
    _warm_up(job, corpus.subset(learned[:WARM_UTTERANCES]))
    with stopwatch() as spent:
        method = job.contestant.train(corpus.subset(learned), job.seed, device_of(job.device))
    method.save(job.model)
    return {
        "train_s": spent.clock_s,
        "train_cpu_s": spent.processor_s,
        "train_minutes": minutes_of(corpus, learned),
        "model_mb": job.model.stat().st_size / MB,
        "tested": list(job.fold.test),
        "learned": method.facts.get("learned"),
    }


def _warm_up(job: Job, few: Corpus) -> None:
    """Whoever comes first pays for what is imported, compiled and opened once a process: learn a little beforehand."""
    name = job.contestant.method
    if name in _warm:
        return
    _warm.add(name)
    settings = job.contestant.create().config
    brief = {key: value for key, value in BRIEF.items() if key in settings}
    with suppress(FacesynthError):  # so little may be too little, and then there is little to warm
        create(name, **{**settings, **brief}).fit(few, seed=job.seed)


def _speak(job: Job, corpus: Corpus, method: Method) -> None:
    """Every tested utterance that has no prediction yet; the model is warm before its time is taken."""
    left = [i for i in job.fold.test if not (read_beside(_path(job, i)) and _path(job, i).is_file())]
    for position, utterance_id in enumerate(left):
        utterance = corpus[utterance_id]
        if position == 0:
            method.synthesize(utterance.speech, seed=job.seed, **job.contestant.speak)
        _speak_one(job, method, utterance)


def _speak_one(job: Job, method: Method, utterance: Utterance) -> None:
    with stopwatch() as spent:
        motion = method.synthesize(utterance.speech, seed=job.seed, **job.contestant.speak)
    path = _path(job, utterance.id)
    save_prediction(path, utterance.id, motion)
    write_beside(path, Beside.of(method, utterance.speech, spent))


def _sample(job: Job, corpus: Corpus, method: Method) -> None:
    """Where another seed makes another motion, keep the motions of SAMPLES seeds, of a few utterances."""
    for utterance_id in some_of(job.fold.test, SAMPLED, job.seed):
        path, speech = _path(job, utterance_id), corpus[utterance_id].speech
        if len(sample_paths(path)) == SAMPLES - 1:
            continue
        for number in range(1, SAMPLES):
            motion = method.synthesize(speech, seed=job.seed + number, **job.contestant.speak)
            if number == 1 and np.array_equal(motion.frames, load_prediction(path)[1].frames):
                return
            save_prediction(sample_path(path, number), utterance_id, motion)


def _peak_mb(job: Job, corpus: Corpus) -> float | None:
    """In the first fold, of its longest utterance; others would tell the same."""
    if job.number > 1:
        return None
    longest = max(job.fold.test, key=corpus.duration_s)
    return peak_speaking_mb(job.model, corpus.path, longest, job.seed, job.contestant.speak)


def read_account(path: Path) -> dict[str, Any]:
    """What is known of a fold's predictions; empty where nothing is."""
    try:
        plain = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return plain if isinstance(plain, dict) else {}


def _path(job: Job, utterance_id: str) -> Path:
    return job.folder / f"{utterance_id}.npz"


def _forget(job: Job, account: dict[str, Any]) -> None:
    """Remove what other settings, recordings or folds left behind, so that nothing of it is taken for new."""
    for utterance_id in {*job.fold.test, *account.get("tested", ())}:
        path = _path(job, utterance_id)
        for one in (path, path.with_suffix(".json"), *sample_paths(path)):
            one.unlink(missing_ok=True)
    job.model.unlink(missing_ok=True)
    job.account.unlink(missing_ok=True)


def _write(path: Path, account: dict[str, Any]) -> None:
    write_text(path, json.dumps(account, indent=1, ensure_ascii=False, allow_nan=False) + "\n")
