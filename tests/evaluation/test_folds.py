import json

import pytest
from corpora import tiny_corpus

from facesynth.evaluation.folds import make_folds, minutes_of, read_folds, some_minutes, write_folds
from facesynth.inference.errors import FacesynthError


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("tiny") / "corpus", utterances=21, fps=30)


def test_every_utterance_is_tested_once_and_kept_folds_are_the_same(corpus, tmp_path):
    folds = make_folds(corpus, 3, 1)
    assert sorted(i for fold in folds for i in fold.test) == sorted(corpus.ids)
    assert folds == make_folds(corpus, 3, 1) != make_folds(corpus, 3, 2)
    write_folds(tmp_path / "folds.json", corpus, folds)
    assert read_folds(tmp_path / "folds.json", corpus) == folds


def test_given_folds_may_name_the_tested_alone(corpus, tmp_path):
    tested = [i for i in corpus.ids if i.startswith("s02")]
    (tmp_path / "f.json").write_text(json.dumps({"folds": [{"test": tested}]}))
    (fold,) = read_folds(tmp_path / "f.json", corpus)
    assert set(fold.train) == set(corpus.ids) - set(tested)


def test_a_large_corpus_is_thinned(corpus):
    folds = make_folds(corpus, 3, test_limit=6, train_minutes=0.1)
    assert [len(fold.test) for fold in folds] == [2, 2, 2]
    assert len({corpus.record(i).emotion for fold in folds for i in fold.test}) > 2
    assert all(0.1 <= minutes_of(corpus, fold.train) < 0.14 for fold in folds)


def test_more_minutes_hold_the_fewer(corpus):
    few, many = (set(some_minutes(corpus, corpus.ids, minutes, 0)) for minutes in (0.1, 0.3))
    assert few < many
    assert set(some_minutes(corpus, corpus.ids, 1000, 0)) == set(corpus.ids)
    with pytest.raises(FacesynthError, match="positive"):
        some_minutes(corpus, corpus.ids, 0, 0)


@pytest.mark.parametrize(
    ("folds", "why"),
    [
        ([{"train": ["s00_happy_t1"], "test": ["s00_neutral_t1"]}], "learned from and tested on"),
        ([{"test": ["s00_neutral_t1"]}, {"test": ["s00_neutral_t1"]}], "in an earlier fold too"),
        ([{"test": ["nobody"]}], "unknown utterance"),
        ([{"test": []}], "no usable utterance to test"),
        ([], "no fold"),
        ([{"tests": []}], "holds no folds"),
        ("text", "holds no folds"),
        ([{"test": "s00_neutral_t1"}], "holds no folds.*test must be a list"),
        ([{"train": "0", "test": ["s00_neutral_t1"]}], "holds no folds.*train must be a list"),
    ],
)
def test_folds_that_leak_or_do_not_fit_are_refused(corpus, tmp_path, folds, why):
    (tmp_path / "f.json").write_text(json.dumps({"folds": folds}))
    with pytest.raises(FacesynthError, match=why):
        read_folds(tmp_path / "f.json", corpus)
