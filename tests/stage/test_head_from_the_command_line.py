"""Heads as people ask for them: a model beside the mouth, through key poses of a file; and the script that trains them."""

import re
import runpy
import sys

import numpy as np
import pytest
from click.testing import CliRunner
from nodding import nodding, nodding_corpus

import facesynth
from facesynth.cli import main
from facesynth.cli.speak import speak
from facesynth.methods.head_knn.method import HeadKnnMethod
from facesynth.methods.registry import load
from facesynth.speech.audio import save_wav
from facesynth.speech.textgrid import write_textgrid


@pytest.fixture(scope="module")
def shop(tmp_path_factory):
    """A mouth, two heads of the same talker, and an unheard sound of 2 s with its phones."""
    folder = tmp_path_factory.mktemp("heads")
    corpus = nodding_corpus(folder / "actor", 12, speed=True)
    facesynth.create("phone_mean").fit(corpus).save(folder / "mouth.safetensors")
    HeadKnnMethod(near=0.02, rough=0.03, away=0.95, neighbours=200).fit(corpus).save(folder / "knn.safetensors")
    facesynth.create("head_hmm", clusters=4).fit(corpus).save(folder / "hmm.safetensors")
    speech, _ = nodding(100, speed=True)
    save_wav(folder / "line.wav", speech.audio, speech.sample_rate)
    write_textgrid(folder / "line.TextGrid", speech.phones)
    (folder / "keys.csv").write_text("time_s,pitch,yaw,roll\n0,0,0,0\n1,5,6,0\n", encoding="utf-8")
    return folder


def spoken(shop, tmp_path, *asked):
    """The NPZ that the command writes."""
    out = tmp_path / "out.npz"
    command = [shop / "mouth.safetensors", shop / "line.wav", "--eyes", "off", "--fps", "60", "-o", out, *asked]
    done = CliRunner().invoke(speak, list(map(str, command)), catch_exceptions=False)
    assert done.exit_code == 0, done.output
    with np.load(out) as arrays:
        return dict(arrays)


def refused(monkeypatch, capsys, shop, tmp_path, *asked):
    """The one line of an error."""
    command = ["speak", shop / "mouth.safetensors", shop / "line.wav", "-o", tmp_path / "out.npz", *asked]
    monkeypatch.setattr(sys, "argv", ["facesynth", *map(str, command)])
    with pytest.raises(SystemExit) as left:
        main()
    assert left.value.code == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    return line


def test_key_poses_of_a_file_move_the_head_that_is_written(shop, tmp_path):
    head = f"knn:{shop / 'knn.safetensors'}"
    keyed = spoken(shop, tmp_path, "--head", head, "--head-keys", shop / "keys.csv")
    free = spoken(shop, tmp_path, "--head", head)
    pose = np.radians([5.0, 6.0])
    off, free_off = (np.linalg.norm(one["head"][60, :2] - pose) for one in (keyed, free))
    assert off < 0.6 * free_off
    assert "head_knn (knn.safetensors)" in str(keyed["sources"])


@pytest.mark.parametrize(
    ("keys", "word"),
    [
        ("1,0,0,0\n0.5,0,0,0\n", "line 3"),
        ("9,0,0,0\n", "outside of the speech"),
        ("a,0,0,0\n", "line 2"),
    ],
)
def test_key_poses_that_cannot_be_are_refused_in_one_line(shop, tmp_path, monkeypatch, capsys, keys, word):
    (tmp_path / "keys.csv").write_text("time_s,pitch,yaw,roll\n" + keys, encoding="utf-8")
    asked = ["--head", shop / "knn.safetensors", "--head-keys", tmp_path / "keys.csv"]
    assert word in refused(monkeypatch, capsys, shop, tmp_path, *asked)


def test_a_head_that_goes_through_no_key_poses_says_so(shop, tmp_path, monkeypatch, capsys):
    asked = ["--head", shop / "hmm.safetensors", "--head-keys", shop / "keys.csv"]
    assert "head" in refused(monkeypatch, capsys, shop, tmp_path, *asked)


@pytest.mark.parametrize("method", ["head_knn", "head_hmm"])
def test_the_training_script_learns_judges_and_saves(shop, repository, tmp_path, capsys, method):
    script = runpy.run_path(str(repository / "train" / "head.py"))
    config = tmp_path / "config.yaml"
    config.write_text({"head_knn": "near: 0.5\nrough: 0.3\naway: 0.2\n", "head_hmm": "clusters: 4\n"}[method], encoding="utf-8")
    made = tmp_path / "made.safetensors"
    script["main"]([str(shop / "actor"), "--method", method, "--config", str(config), "-o", str(made)])
    told = capsys.readouterr().out
    assert re.search(r"\d+ utterances to learn from, \d+ to judge by", told)
    assert re.search(r"\d+\.\d+", told.splitlines()[-2])
    assert load(made).name == method


def test_the_packages_head_is_learned_from_people_who_turn_as_far_as_each_other(shop, repository, tmp_path, capsys):
    script = runpy.run_path(str(repository / "train" / "packaged_head.py"))
    other = nodding_corpus(tmp_path / "other", 6)
    script["main"]([str(shop / "actor"), str(other.path), "-o", str(tmp_path / "made.safetensors")])
    spreads, gains = np.array(re.findall(r"turns by ([\d.]+) degrees, taken ([\d.]+) times", capsys.readouterr().out), float).T
    assert np.prod(gains) == pytest.approx(1, abs=0.02)
    assert spreads[0] * gains[0] == pytest.approx(spreads[1] * gains[1], rel=0.05)
    assert load(tmp_path / "made.safetensors").capabilities.part == "head"
