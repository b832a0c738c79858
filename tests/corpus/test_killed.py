"""Imports that are killed, by two workers and by Ray, and conversions: run again they give the same bytes."""

import importlib.util
from functools import partial

import numpy as np
import pytest
from corpora import tiny_layout, tiny_utterances
from interrupted import killed_and_repeated

from facesynth.corpus import Corpus
from facesynth.speech.audio import save_wav
from facesynth.speech.textgrid import write_textgrid


@pytest.fixture
def session(tmp_path):
    """Eight recordings: sound, phones and 3-D markers."""
    folder = tmp_path / "session"
    folder.mkdir()
    for record, speech, motion in tiny_utterances(8):
        save_wav(folder / f"{record.id}.wav", speech.audio, speech.sample_rate)
        write_textgrid(folder / f"{record.id}.TextGrid", speech.phones, ())
        np.savez(folder / f"{record.id}.npz", frames=motion.frames, fps=motion.fps, head=motion.head, eyes=motion.eyes)
    return folder


def new(folder):
    Corpus.create(folder, performer="A", layout=tiny_layout(), fps=120, emotions=["neutral"])


def adding(session, target, *options):
    return ["add", str(target), str(session), *options]


def test_killed_five_times_and_run_again_gives_the_same_bytes(session, tmp_path):
    killed_and_repeated(lambda target: adding(session, target, "--jobs", "2"), tmp_path, 5, seed=5, new=new)


@pytest.mark.slow
def test_killed_fifty_times_and_run_again_gives_the_same_bytes(session, tmp_path):
    killed_and_repeated(lambda target: adding(session, target, "--jobs", "2"), tmp_path, 50, seed=7, new=new)


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("ray") is None, reason="ray is not installed: pip install 'facesynth[ray]'")
def test_killed_while_ray_works_and_run_again_gives_the_same_bytes(session, tmp_path):
    """Ray's own agents take a minute to notice."""
    command = partial(adding, session)
    rays = ["--jobs", "2", "--engine", "ray"]
    killed_and_repeated(lambda target: command(target, *rays), tmp_path, 10, seed=9, new=new, patience_s=180)


def converting(session, tmp_path):
    layout = tmp_path / "layout.yaml"
    layout.write_text(_yaml(), encoding="utf-8")
    return lambda target: ["convert", str(session), "--layout", str(layout), "-o", str(target)]


def _yaml():
    import yaml

    return yaml.safe_dump(tiny_layout().to_dict())


def test_a_conversion_killed_twice_and_run_again_gives_the_same_bytes(session, tmp_path):
    killed_and_repeated(converting(session, tmp_path), tmp_path, 2, seed=3)


@pytest.mark.slow
def test_a_conversion_killed_fifty_times_and_run_again_gives_the_same_bytes(session, tmp_path):
    killed_and_repeated(converting(session, tmp_path), tmp_path, 50, seed=4)
