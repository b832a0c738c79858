"""The search of eFASE's parameters: over several corpora, repeatable, resumable, the same whoever evaluates."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
import yaml
from click.testing import CliRunner
from corpora import tiny_corpus

from facesynth.cli.tune import tune as tune_verb
from facesynth.corpus import Corpus
from facesynth.corpus.workers import ALONE, ENGINES, Workers
from facesynth.inference.errors import FacesynthError
from facesynth.methods.efase import tuning
from facesynth.methods.efase.method import Efase
from facesynth.methods.efase.tuning import (
    PUBLISHED,
    RANGES,
    Job,
    Recordings,
    errors_of,
    split_for_tuning,
    tune,
)
from facesynth.methods.efase.tuning_search import ChangingSettings, examples_of, sentence_errors


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """Two performers, a model of each, and sentences held out."""
    folder, made = tmp_path_factory.mktemp("tuning"), []
    for name, fps in (("one", 60), ("other", 25)):
        corpus = tiny_corpus(folder / name, utterances=12, fps=fps)
        header = corpus.path / "corpus.yaml"
        plain = yaml.safe_load(header.read_text(encoding="utf-8"))
        header.write_text(yaml.safe_dump({**plain, "performer": name}), encoding="utf-8")
        database, *held_out = split_for_tuning(Corpus.open(corpus.path), 2, 2, seed=0)
        path = folder / f"{name}.safetensors"
        Efase(maps=False).fit(database).save(path)
        made.append(Recordings(corpus.path, name, path, *(part.ids for part in held_out)))
    return made


@pytest.fixture(scope="module")
def small_groups():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tuning, "CROWD", 1)
        yield


@pytest.fixture(scope="module")
def found(recordings, small_groups, tmp_path_factory):
    journal = tmp_path_factory.mktemp("journal") / "j.jsonl"
    return tune(recordings, journal=journal, generations=0, seed=0), journal


def test_parts_share_no_sentence(tmp_path):
    parts = split_for_tuning(tiny_corpus(tmp_path / "actor", utterances=20, fps=60), 2, 2, seed=0)
    sentences = [{corpus.record(i).sentence for i in corpus.ids} for corpus in parts]
    assert sum(map(len, sentences)) == len(set.union(*sentences))
    assert len(parts[1]) == len(parts[2]) == 2


def test_what_is_found_stands_before_every_other_evaluation(recordings, found):
    best, journal = found
    assert best.evaluations == len(RANGES)
    assert all(low <= best.settings[name] <= high for name, (low, high) in RANGES.items())
    rows = [json.loads(line) for line in journal.read_text(encoding="utf-8").splitlines()[1:]]
    errors = {}
    for row in rows:
        performer, settings = json.loads(row["key"])
        errors.setdefault(json.dumps(settings), {})[performer] = row["error"]
    assert len(errors) == best.evaluations
    config = Efase.load(recordings[0].model).config
    own = errors[json.dumps({name: config[name] for name in sorted(RANGES)})]
    assert set(own) == {"one", "other"}
    ratios = [{one: error / own[one] for one, error in tried.items()} for tried in errors.values()]
    assert all(len(one) == (1 if one["one"] > tuning.HOPELESS else 2) for one in ratios)  # then the second is not asked
    standings = [np.log(list(one.values())).mean() + 10 * max(0, *np.log(list(one.values()))) for one in ratios]
    assert tuning.standing(list(best.ratios.values())) == pytest.approx(min(standings))
    assert min(standings) <= 0


def test_a_loss_on_one_corpus_outweighs_ten_times_the_gain_over_all():
    assert tuning.standing([0.9, 0.9]) == pytest.approx(np.log(0.9))
    assert tuning.standing([0.5, 1.1, 0.5]) > tuning.standing([1.0, 1.0, 1.0]) == 0
    assert tuning.standing([0.9, 1.001, 0.9]) < 0


def test_test_errors_are_those_of_a_model_with_the_settings(recordings, found):
    for of, tested in zip(recordings, found[0].tested, strict=True):
        model, test = Efase.load(of.model), Corpus.open(of.corpus).subset(of.test)
        examples = examples_of(model, test)
        assert tested.published == pytest.approx(np.mean(sentence_errors(model.with_weights(**PUBLISHED).speaker, examples)))
        assert tested.found == pytest.approx(np.mean(sentence_errors(model.with_weights(**found[0].settings).speaker, examples)))
        assert tested.default == pytest.approx(np.mean(errors_of(Job((), of, of.test))))
        assert tested.nearer + tested.farther <= len(of.test)


def test_kept_tables_find_what_a_model_with_other_settings_finds(recordings, tmp_path, monkeypatch):
    monkeypatch.setattr("facesynth.methods.learn.expectation.STEPS", 3)
    database, tuning_part, _ = split_for_tuning(Corpus.open(recordings[0].corpus), 2, 2, seed=0)
    model = Efase(maps=False, temperature=1.0, candidates=6, audio_weight=1.0, pose_weight=1.0, expected_share=0.5).fit(database)
    changing, examples = ChangingSettings(model), examples_of(model, tuning_part)
    for temperature in (0.0, 0.4):
        other = {**PUBLISHED, "temperature": temperature, "audio_weight": 0.3, "pose_weight": 2.0, "expected_share": 0.2}
        plain = sentence_errors(model.with_weights(**other).speaker, examples)
        assert sentence_errors(changing.speaker(other), examples) == pytest.approx(plain, rel=1e-6)


@pytest.mark.parametrize(
    "workers",
    [ALONE, *(pytest.param(Workers(2, engine), marks=pytest.mark.slow) for engine in ENGINES)],
    ids=lambda one: f"{one.engine} {one.jobs}",
)
def test_an_interrupted_search_goes_on_and_ends_alike_by_other_workers(recordings, found, workers, tmp_path):
    if workers.engine == "ray":
        pytest.importorskip("ray")
    best, journal = found
    lines = journal.read_text(encoding="utf-8").splitlines(keepends=True)
    cut = tmp_path / "j.jsonl"
    cut.write_text("".join(lines[:9]) + lines[9][:9], encoding="utf-8")
    assert tune(recordings, journal=cut, generations=0, seed=0, workers=workers) == best


def test_a_journal_of_another_search_is_refused(recordings, found):
    with pytest.raises(FacesynthError, match="another search"):
        tune(recordings, journal=found[1], generations=0, seed=1)
    with pytest.raises(FacesynthError, match="another search"):
        tune(recordings[:1], journal=found[1], generations=0, seed=0)


@pytest.mark.parametrize("content", ["", "garbage\n", "[1, 2]\n"])
def test_a_journal_that_is_none_is_refused(recordings, tmp_path, content):
    (tmp_path / "j.jsonl").write_text(content, encoding="utf-8")
    with pytest.raises(FacesynthError, match="or to none"):
        tune(recordings, journal=tmp_path / "j.jsonl", generations=0)


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


def test_too_many_sentences_are_refused(tmp_path):
    with pytest.raises(FacesynthError, match="only"):
        split_for_tuning(tiny_corpus(tmp_path / "actor", utterances=8, fps=60), 100, 100, seed=0)


@pytest.mark.usefixtures("small_groups")
def test_from_the_command_line_settings_are_written_and_each_corpus_has_its_row(recordings, tmp_path):
    output, paths = tmp_path / "found.yaml", [str(of.corpus) for of in recordings]
    asked = ["--sentences", "2", "--test", "2", "--generations", "0", "--workers", "1", "-o", str(output)]
    result = CliRunner().invoke(tune_verb, [*paths, *asked], catch_exceptions=False)
    assert set(yaml.safe_load(output.read_text(encoding="utf-8"))) == set(RANGES)
    assert "| one |" in result.output
    assert "| other |" in result.output
    with pytest.raises(FacesynthError, match="another performer"):
        CliRunner().invoke(tune_verb, [paths[0], paths[0], *asked], catch_exceptions=False)


@pytest.mark.usefixtures("small_groups")
def test_the_soft_form_searches_its_temperature_and_what_it_hears(recordings, tmp_path):
    corpus = Corpus.open(recordings[0].corpus)
    database = split_for_tuning(corpus, 2, 2, seed=0)[0]
    path = tmp_path / "soft.safetensors"
    Efase(maps=False, temperature=1.0, candidates=5, audio_weight=1.0).fit(database).save(path)
    soft = replace(recordings[0], model=path)
    best = tune([soft], journal=tmp_path / "soft.jsonl", generations=0)
    assert set(best.settings) == {*RANGES, "temperature", "audio_weight"}
