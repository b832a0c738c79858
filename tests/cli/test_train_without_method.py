"""`facesynth train CORPUS`: who names no method gets what is nearest to recordings."""

import pytest
from click.testing import CliRunner
from corpora import tiny_corpus

from facesynth.cli.train import train
from facesynth.methods.learn import expectation, windows
from facesynth.methods.registry import load


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("nearest") / "corpus", utterances=8, fps=50).path


def test_a_corpus_alone_trains_the_nearest_method_with_its_nearest_settings(corpus, tmp_path, monkeypatch):
    monkeypatch.setattr(expectation, "STEPS", 2)
    monkeypatch.setattr(windows, "BATCH", 2)
    path = tmp_path / "model.safetensors"
    done = CliRunner().invoke(train, [str(corpus), "learn=false", "candidates=7", "-o", str(path)])
    assert done.exit_code == 0, done.output
    model = load(path)
    assert model.config == {**type(model)().config, **model.capabilities.nearest, "learn": False, "candidates": 7}


def test_a_method_with_a_corpus_has_its_own_defaults(corpus, tmp_path):
    path = tmp_path / "model.safetensors"
    done = CliRunner().invoke(train, ["efase", str(corpus), "candidates=7", "-o", str(path)])
    assert done.exit_code == 0, done.output
    assert load(path).config["temperature"] == 0


@pytest.mark.parametrize("words", [[], ["efase"], ["nowhere/"], ["nowhere/", "candidates=7"]])
def test_what_names_no_corpus_is_told_what_was_wanted(words):
    done = CliRunner().invoke(train, words)
    assert done.exit_code == 2
    assert "corpus" in done.output
