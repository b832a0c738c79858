"""Which sentences are learned from and which are tested on: said once, kept in a file, the same for every method."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from facesynth.atomic import write_text
from facesynth.corpus import Corpus
from facesynth.inference.errors import FacesynthError

FORMAT = 1
"""Version of the file."""


@dataclass(frozen=True)
class Fold:
    """One way of splitting a corpus."""

    train: tuple[str, ...]
    """Ids of the utterances to learn from."""
    test: tuple[str, ...]
    """Ids of the utterances to speak and be judged by; none shares a sentence with `train`."""


def make_folds(
    corpus: Corpus, count: int, seed: int = 0, *, test_limit: int | None = None, train_minutes: float | None = None
) -> tuple[Fold, ...]:
    """`count` folds by sentence: every sentence is tested on once, in all its emotions and takes.

    test_limit: at most so many tested utterances in all, drawn from each fold alike; train_minutes: learn from so
    many minutes of each fold's recordings (see `some_minutes`). Both make a large corpus quick to judge.
    """
    folds = [Fold(train.ids, test.ids) for train, test in corpus.folds(count, seed)]
    limit = None if test_limit is None else max(1, round(test_limit / count))
    return tuple(
        Fold(
            fold.train if train_minutes is None else some_minutes(corpus, fold.train, train_minutes, seed),
            fold.test if limit is None else some_of(fold.test, limit, seed),
        )
        for fold in folds
    )


def some_minutes(corpus: Corpus, ids: Sequence[str], minutes: float, seed: int) -> tuple[str, ...]:
    """Utterances drawn until they last `minutes`, all where there are no more; more minutes hold the fewer ones too."""
    if not minutes > 0:
        raise FacesynthError(f"the minutes to learn from must be positive; got {minutes}")
    chosen: list[str] = []
    left_s = 60 * minutes
    for utterance_id in np.random.default_rng(seed).permutation(np.array(sorted(ids), object)):
        if left_s <= 0:
            break
        chosen.append(str(utterance_id))
        left_s -= corpus.duration_s(utterance_id)
    return tuple(sorted(chosen))


def some_of(ids: Sequence[str], count: int, seed: int) -> tuple[str, ...]:
    """At most `count` utterances, drawn: every n-th of a sorted list could be one emotion throughout."""
    if len(ids) <= count:
        return tuple(ids)
    return tuple(sorted(map(str, np.random.default_rng(seed).permutation(np.array(sorted(ids), object))[:count])))


def minutes_of(corpus: Corpus, ids: Iterable[str]) -> float:
    """How long utterances last together, minutes."""
    return sum(corpus.duration_s(utterance_id) for utterance_id in ids) / 60


def write_folds(path: str | Path, corpus: Corpus, folds: Sequence[Fold]) -> None:
    """Keep folds as JSON, with the corpus that they split."""
    plain = {
        "format": FORMAT,
        "performer": corpus.performer,
        "corpus_sha256": corpus.provenance()["sha256"],
        "folds": [{"train": list(fold.train), "test": list(fold.test)} for fold in folds],
    }
    write_text(path, json.dumps(plain, indent=1, ensure_ascii=False) + "\n")


def read_folds(path: str | Path, corpus: Corpus) -> tuple[Fold, ...]:
    """Folds that `write_folds` kept or a person wrote; `train` may be left out and is then every other sentence.

    Refused, with the reason: ids that the corpus lacks, a sentence learned from and tested on, an utterance tested twice.
    """
    wanted = 'wanted JSON with "folds": [{"train": [ids], "test": [ids]}, …]'
    try:
        plain = json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise FacesynthError(f"{path} holds no folds ({error}); {wanted}") from None
    if not isinstance(plain, dict) or not isinstance(plain.get("folds"), list):
        raise FacesynthError(f"{path} holds no folds; {wanted}")
    if plain.get("format", FORMAT) != FORMAT:
        raise FacesynthError(f"{path} has format {plain['format']}; this facesynth reads {FORMAT}")
    for fold in plain["folds"]:
        if not isinstance(fold, dict) or "test" not in fold:
            raise FacesynthError(f"{path} holds no folds: got {fold!r}; {wanted}")
        for name in fold.keys() & {"train", "test"}:
            if not isinstance(fold[name], list):
                raise FacesynthError(f"{path} holds no folds: {name} must be a list of ids; {wanted}")
    folds = tuple(_fold(corpus, fold) for fold in plain["folds"])
    check_folds(corpus, folds)
    return folds


def check_folds(corpus: Corpus, folds: Sequence[Fold]) -> None:
    """FacesynthError where folds do not fit the corpus or leak a sentence from test to train."""
    if not folds:
        raise FacesynthError("there is no fold; a comparison needs at least one")
    tested: set[str] = set()
    for number, fold in enumerate(folds, 1):
        sentences = [{corpus.record(i).sentence_key for i in ids} for ids in (fold.train, fold.test)]
        for ids, what in ((fold.train, "learn from"), (fold.test, "test on")):
            if not ids:
                raise FacesynthError(f"fold {number} has no usable utterance to {what}; record more, or split otherwise")
        if both := sentences[0] & sentences[1]:
            raise FacesynthError(f"fold {number}: sentence {min(both)!r} is learned from and tested on; split by sentence")
        if again := tested & set(fold.test):
            raise FacesynthError(f"fold {number}: utterance {min(again)!r} is tested on in an earlier fold too")
        tested |= set(fold.test)


def rest_of(corpus: Corpus, tested: Iterable[str]) -> Fold:
    """The fold that tests on these utterances and learns from every other sentence."""
    test = tuple(sorted(tested))
    sentences = {corpus.record(i).sentence_key for i in test}
    return Fold(tuple(r.id for r in corpus.usable_records if r.sentence_key not in sentences), test)


def _fold(corpus: Corpus, plain: dict[str, Any]) -> Fold:
    test = tuple(map(str, plain["test"]))
    return Fold(tuple(map(str, plain["train"])), test) if "train" in plain else rest_of(corpus, test)
