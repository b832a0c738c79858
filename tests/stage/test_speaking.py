"""The one way from speech to a face, from Python."""

import json
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from corpora import tiny_corpus

import facesynth
from facesynth.face.files.npz import read_npz
from facesynth.face.rig.anny import head_folder
from facesynth.inference.errors import FacesynthError
from facesynth.speech.audio import save_wav
from facesynth.speech.textgrid import write_textgrid
from facesynth.stage.request import Part, Request


@pytest.fixture(scope="module")
def shop(tmp_path_factory):
    """A model and a recording with its phones."""
    try:
        head_folder()
    except ValueError as error:
        pytest.skip(str(error))
    folder = tmp_path_factory.mktemp("stage")
    corpus = tiny_corpus(folder / "actor", utterances=8, fps=60)
    facesynth.create("phone_mean").fit(corpus).save(folder / "model.safetensors")
    speech = corpus[corpus.ids[0]].speech
    save_wav(folder / "clip.wav", speech.audio, speech.sample_rate)
    write_textgrid(folder / "clip.TextGrid", speech.phones)
    return folder


def test_a_model_says_a_recording(shop, tmp_path):
    spoken = facesynth.speak(shop / "model.safetensors", shop / "clip.wav", tmp_path / "a.npz", emotion="happy", fps=25)
    animation, motion = read_npz(tmp_path / "a.npz")
    assert animation.fps == 25
    assert motion.fps == spoken.motion.fps == 60
    np.testing.assert_array_equal(motion.frames, spoken.motion.frames)
    assert set(spoken.speech.emotions.labels) == {"happy"}
    assert spoken.written == (tmp_path / "a.npz",)
    assert json.loads(json.dumps(spoken.facts))["phones"] == "textgrid"
    assert spoken.remarks[1:] == (f"{tmp_path / 'a.npz'}: {spoken.speech.duration_s:.2f} s at 25 fps",)
    assert animation.sources == spoken.facts["parts"]
    assert set(animation.sources) == {"mouth", "head", "eyes"}
    assert animation.sources["mouth"] == "phone_mean (model.safetensors)"
    assert spoken.remarks[0] == "; ".join(f"{part}: {source}" for part, source in spoken.facts["parts"].items())


def test_without_a_file_there_is_the_motion_alone(shop):
    spoken = facesynth.speak(shop / "model.safetensors", str(shop / "clip.wav"), phones=str(shop / "clip.TextGrid"))
    assert spoken.written == ()
    assert len(spoken.motion) == spoken.speech.phones.frame_bounds(60)[-1]


def test_a_head_that_nobody_recorded_sways_only_where_nothing_else_is_asked_for(shop, tmp_path):
    moved = {}
    for name, part in (("default", Part()), ("recorded", Part("recorded")), ("off", Part("off"))):
        out = tmp_path / f"{name}.npz"
        facesynth.speak(shop / "model.safetensors", shop / "clip.wav", out, head=part, eyes=part)
        moved[name] = read_npz(out)[0]
    for name, gain in (("alone", 1.0), ("alone, double", 2.0)):  # no gaze that the head would follow
        out = tmp_path / f"{name}.npz"
        facesynth.speak(shop / "model.safetensors", shop / "clip.wav", out, head=Part(gain=gain), eyes=Part("off"))
        moved[name] = read_npz(out)[0]
    assert np.abs(moved["default"].head[:, :3]).max() > 1e-3
    np.testing.assert_allclose(moved["alone, double"].head[:, :3], 2 * moved["alone"].head[:, :3], atol=1e-4)
    assert np.abs(moved["default"].gaze).max() > 1e-3
    for name in ("recorded", "off"):
        np.testing.assert_allclose(moved[name].head, 0, atol=1e-6)
        np.testing.assert_allclose(moved[name].gaze, 0, atol=1e-6)


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"emotoin": "happy"}, "unknown option of speak 'emotoin'; did you mean emotion"),
        ({"emotion": "bored"}, "unknown emotion 'bored'"),
        ({"look_ahead": 3}, "phone_mean has no option --look-ahead; it is one of anime_graph"),
        ({"explain": "why.json"}, "phone_mean tells nothing of its choices; anime_graph and efase explain them"),
        ({"to_emotion": "happy"}, "phone_mean learns no emotion maps; give a model .* with --maps"),
    ],
)
def test_what_cannot_be_done_is_refused_before_anything_is_heard(shop, tmp_path, asked, message):
    with pytest.raises(FacesynthError, match=message):
        facesynth.speak(shop / "model.safetensors", tmp_path / "no sound.wav", tmp_path / "o.npz", **asked)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"emotion": "happy", "emotions": "e.csv"}, "give one"),
        ({"emotions": "e.csv", "intensity": 0.5}, "of its own"),
        ({"maps": "m.safetensors"}, "--maps belongs to --to-emotion"),
        ({"to_intensity": 1.5}, "to_intensity must lie from 0 to 1"),
        ({"deform": "bones"}, "unknown deform 'bones'"),
        ({"fps": Fraction(0)}, "a rate from 1 to 1000 Hz"),
        ({"size": (641, 480)}, "both even"),
        ({"size": (16, 16)}, "from 32 to 4096"),
    ],
)
def test_a_request_that_contradicts_itself_is_none(asked, message):
    with pytest.raises(FacesynthError, match=message):
        Request(**asked)


def test_parts_and_paths_of_a_request():
    assert Request(phones="a.lab").phones == Path("a.lab")
    assert Request(emotions="auto").listens
    assert not Request(emotion="happy").listens
    assert Part("off").factor == 0
    with pytest.raises(FacesynthError, match="unknown source"):
        Part("nobody")
    with pytest.raises(FacesynthError, match="0 or above"):
        Part(gain=float("inf"))


def test_a_layout_that_a_method_does_not_learn_is_refused(shop, monkeypatch):
    from dataclasses import replace

    from facesynth.methods.registry import method_class

    cls = method_class("phone_mean")
    monkeypatch.setattr(cls, "capabilities", replace(cls.capabilities, layouts=("curves",)))
    with pytest.raises(FacesynthError, match=r"phone_mean learns curves; .*actor holds markers"):
        cls().fit(facesynth.Corpus.open(shop / "actor"))
