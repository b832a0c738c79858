"""What is learned does not depend on who learns it: one process, several, or Ray."""

import importlib.util
import pickle

import pytest
from click.testing import CliRunner
from corpora import tiny_corpus

from facesynth.cli.train import train as train_verb
from facesynth.corpus.workers import ALONE, Workers
from facesynth.inference.errors import FacesynthError
from facesynth.methods.learn import spreading
from facesynth.methods.learn.other_voices import Change, other_voice
from facesynth.methods.learn.spreading import in_pieces, working
from facesynth.methods.registry import method_class
from facesynth.methods.training import train

LEARNING = {
    "efase": {"learn": True, "temperature": 1.0, "pose_weight": 1.0, "sharpening": 1.0, "voices": 1, "candidates": 6},
    "anime_graph": {"learn": True, "temperature": 2.0, "pose_weight": 1.0, "sharpening": 1.0},
    "lds": {"hears": "periodogram", "context_ms": 0.0, "features": 4, "components": 3, "rows": 3},
}
PIECES = {
    "efase": {"listening", "lattices", "sharpening"},
    "anime_graph": {"listening", "lattices", "sharpening", "emotion maps"},
    "lds": {"lead of the sound", "numbers of states", "states of the noise"},
}
"""What of each is done in pieces."""
ray = pytest.param("ray", marks=pytest.mark.skipif(importlib.util.find_spec("ray") is None, reason="ray is not installed"))


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("spreading") / "actor", utterances=14, fps=60)


@pytest.fixture(scope="module")
def alone(corpus, tmp_path_factory):
    """The files of models that one process made, each made when it is first asked for."""
    folder, made = tmp_path_factory.mktemp("alone"), {}

    def by_one(name):
        if name not in made:
            made[name] = learned(name, corpus, folder / name)
        return made[name]

    return by_one


@pytest.fixture(autouse=True)
def few_steps(monkeypatch):
    monkeypatch.setattr("facesynth.methods.learn.expectation.STEPS", 3)


def learned(name, corpus, path):
    train(method_class(name), corpus, LEARNING[name]).save(path)
    return path.read_bytes()


@pytest.mark.parametrize("name", LEARNING)
def test_pieces_that_went_through_another_process_make_the_same_model(name, corpus, alone, tmp_path, monkeypatch):
    asked = []

    def sent(function, items, workers, what):
        """As processes do it: function, items and results travel as bytes, and the last item may be done first."""
        asked.append(what)
        work = pickle.dumps(function)
        done = [pickle.dumps(pickle.loads(work)(pickle.loads(pickle.dumps(item)))) for item in reversed(items)]  # noqa: S301 - made here
        return map(pickle.loads, reversed(done))

    expected = alone(name)
    monkeypatch.setattr(spreading, "spread", sent)
    assert learned(name, corpus, tmp_path / name) == expected
    assert set(asked) == PIECES[name]


@pytest.mark.parametrize("engine", ["processes", pytest.param(*ray.values, marks=[*ray.marks, pytest.mark.slow])])
def test_workers_choose_the_same_system(engine, corpus, alone, tmp_path):
    with working(Workers(2, engine)) as team:
        assert learned("lds", corpus, tmp_path / "lds") == alone("lds")
    assert team.pieces > len(PIECES["lds"])


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["processes", ray])
@pytest.mark.parametrize("name", ["efase", "anime_graph"])
def test_workers_learn_the_same_weights(name, engine, corpus, alone, tmp_path):
    with working(Workers(2, engine)) as team:
        assert learned(name, corpus, tmp_path / name) == alone(name)
    assert team.pieces > len(corpus)


def test_who_works_is_forgotten_after_the_block():
    with working(Workers(3)) as team:
        with working(ALONE) as inner:
            assert list(in_pieces(abs, [-1, 2], "pieces")) == [1, 2]
        assert list(in_pieces(abs, [-3], "pieces")) == [3]
    assert list(in_pieces(abs, [-4], "pieces")) == [4]
    assert (inner.pieces, team.pieces) == (2, 1)


def test_voices_are_drawn_as_if_they_were_heard_one_after_the_other():
    import numpy as np

    sound = np.random.default_rng(1).standard_normal(16000).astype(np.float32) / 10
    heard, drawn = np.random.default_rng(2), np.random.default_rng(2)
    for length in range(15001, 15021):
        other_voice(sound[:length], heard)
        Change.drawn(length, drawn)
        assert heard.bit_generator.state == drawn.bit_generator.state


def test_from_the_command_line_a_method_without_pieces_says_so(corpus, tmp_path):
    path = tmp_path / "model.safetensors"
    asked = ["phone_mean", str(corpus.path), "-o", str(path), "--jobs", "2"]
    result = CliRunner().invoke(train_verb, asked, catch_exceptions=False)
    assert path.is_file()
    assert "phone_mean learned in one process" in result.stderr


def test_an_accelerator_is_not_shared(monkeypatch, corpus, tmp_path):
    import torch

    monkeypatch.setattr("facesynth.device.device_of", lambda name: torch.device("cuda"))
    asked = ["efase", str(corpus.path), "-o", str(tmp_path / "m"), "--jobs", "2"]
    with pytest.raises(FacesynthError, match="--device cpu"):
        CliRunner().invoke(train_verb, asked, catch_exceptions=False)
