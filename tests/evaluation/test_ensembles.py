"""Networks that learn what several others expect: what they are shown, and the script that measures them."""

import runpy
import sys
from importlib import import_module

import numpy as np
import pytest
from corpora import tiny_corpus

from facesynth.inference.motion import Motion
from facesynth.methods.learn import windows
from facesynth.methods.registry import load


@pytest.fixture
def ensembles(monkeypatch, repository):
    monkeypatch.syspath_prepend(repository / "benchmarks")
    return import_module("ensembles")


def test_what_is_shown_lies_between_recorded_and_made_frames_and_gaps_stay(ensembles):
    recorded = np.array([[0.0, 0.0], [np.nan, 2.0], [4.0, 4.0]])
    shown = ensembles.between(recorded, np.ones((2, 2)), 0.5)
    np.testing.assert_array_equal(shown, [[0.5, 0.5], [np.nan, 1.5], [4.0, 4.0]])


def test_the_mean_of_several_is_nearer_where_they_err_apart(ensembles, tmp_path):
    clips = list(tiny_corpus(tmp_path / "corpus", utterances=6, fps=25))
    rng = np.random.default_rng(0)

    def wrong():
        return {u.id: Motion(u.motion.frames + rng.normal(size=u.motion.frames.shape), 25, u.motion.layout) for u in clips}

    rows = {"one": wrong(), "two": wrong(), "three": wrong()}
    rows["mean"] = ensembles.mean_of(list(rows.values()))
    errors = [float(line.split("|")[2]) for line in ensembles.table(rows, clips)[2:]]
    assert errors[3] == pytest.approx(np.mean(errors[:3]) / np.sqrt(3), rel=0.05)


def test_networks_learn_what_the_mean_says_in_place_of_the_recordings(ensembles, monkeypatch, repository, tmp_path, capsys):
    monkeypatch.setattr(windows, "BATCH", 2)
    corpus, kept = tiny_corpus(tmp_path / "corpus", utterances=15, fps=25), tmp_path / "kept"
    asked = ("--variant", "bands", "--members", "2", "--steps", "1")
    monkeypatch.setattr(sys, "argv", ["ensembles.py", str(corpus.path), "-o", str(kept), *asked])
    runpy.run_path(str(repository / "benchmarks" / "ensembles.py"), run_name="__main__")
    rows = [line.split("|")[1].strip() for line in capsys.readouterr().out.splitlines() if line.startswith("| ")]
    assert rows[1:4] == ["one, seed 0", "one, seed 1", "the mean of them"]
    assert len(rows) == 6
    names = ("1_bands_1steps_0", "1_bands_taught_1_by_2_1steps_0", "1_bands_taught_0.5_by_2_1steps_0")
    speech = corpus[corpus.ids[0]].speech
    own, taught, halfway = (load(kept / f"{name}.safetensors").synthesize(speech).frames for name in names)
    assert not np.array_equal(own, taught)
    assert not np.array_equal(taught, halfway)
