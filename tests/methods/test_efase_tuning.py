"""The search of eFASE's parameters: repeatable, resumable, the same with more processes."""

import csv

import pytest
from corpora import tiny_corpus

from facesynth.corpus import Corpus
from facesynth.inference.errors import FacesynthError
from facesynth.methods.efase.method import Efase
from facesynth.methods.efase.tuning import CROWD, PUBLISHED, RANGES, examples_of, mean_error, split_for_tuning, tune


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    corpus = tiny_corpus(tmp_path_factory.mktemp("tuning") / "actor", utterances=20, fps=60)
    return split_for_tuning(corpus, 2, 2, seed=0)


@pytest.fixture(scope="module")
def model(parts):
    return Efase().fit(parts[0])


@pytest.fixture(scope="module")
def found(parts, model, tmp_path_factory):
    journal = tmp_path_factory.mktemp("journal") / "j.jsonl"
    return tune(model, parts[1], parts[2], journal=journal, generations=0, seed=0), journal


def test_parts_share_no_sentence(parts):
    sentences = [{corpus.record(i).sentence for i in corpus.ids} for corpus in parts]
    assert sum(map(len, sentences)) == len(set.union(*sentences))
    assert len(parts[1]) == len(parts[2]) == 2


def test_what_is_found_is_at_least_as_good_as_every_other_evaluation(parts, model, found):
    tuning, journal = found
    lines = journal.read_text(encoding="utf-8").splitlines()
    assert tuning.evaluations == len(lines) - 1 == CROWD * len(RANGES)
    assert mean_error(model.with_weights(**tuning.settings), examples_of(model, parts[1])) == pytest.approx(tuning.error)
    assert all(low <= tuning.settings[name] <= high for name, (low, high) in RANGES.items())
    assert tuning.published_test_error == pytest.approx(mean_error(model.with_weights(**PUBLISHED), examples_of(model, parts[2])))


def test_an_interrupted_search_goes_on_and_ends_alike_with_more_processes(parts, model, found, tmp_path):
    tuning, journal = found
    lines = journal.read_text(encoding="utf-8").splitlines(keepends=True)
    cut = tmp_path / "j.jsonl"
    cut.write_text("".join(lines[:20]) + lines[20][:9], encoding="utf-8")
    again = tune(model, parts[1], parts[2], journal=cut, generations=0, seed=0, workers=2)
    assert again == tuning


def test_a_journal_of_another_search_is_refused(parts, model, found):
    with pytest.raises(FacesynthError, match="another search"):
        tune(model, parts[1], parts[2], journal=found[1], generations=0, seed=1)


@pytest.mark.parametrize("content", ["", "garbage\n", "[1, 2]\n"])
def test_a_journal_that_is_none_is_refused(parts, model, tmp_path, content):
    (tmp_path / "j.jsonl").write_text(content, encoding="utf-8")
    with pytest.raises(FacesynthError, match="or to none"):
        tune(model, parts[1], parts[2], journal=tmp_path / "j.jsonl", generations=0)


def test_sentences_without_a_name_are_told_apart_by_their_words(tmp_path):
    corpus = tiny_corpus(tmp_path / "actor", utterances=8, fps=60)
    table = corpus.path / "utterances.csv"
    rows = list(csv.DictReader(table.read_text(encoding="utf-8").splitlines()))
    with table.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows({**row, "sentence": "", "text": f"line {number}"} for number, row in enumerate(rows))
    parts = split_for_tuning(Corpus.open(corpus.path), 2, 2, seed=0)
    texts = [{part.record(i).text for i in part.ids} for part in parts]
    assert len(set.union(*texts)) == sum(map(len, texts)) == 8


def test_too_many_sentences_are_refused(parts):
    with pytest.raises(FacesynthError, match="only"):
        split_for_tuning(parts[0], 100, 100, seed=0)
