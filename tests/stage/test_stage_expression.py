"""Emotions added to the neutral motion of any mouth, as strong as a number or a curve says."""

import numpy as np
import pytest
from click.testing import CliRunner
from corpora import twin_corpus

import facesynth
from facesynth.cli.speak import speak
from facesynth.face.rig.anny import head_folder
from facesynth.inference.errors import FacesynthError
from facesynth.inference.speech import EmotionTrack
from facesynth.methods.registry import load
from facesynth.speech.audio import save_wav
from facesynth.speech.intensity import read_intensity
from facesynth.speech.textgrid import write_textgrid
from facesynth.stage.cast import cast_for
from facesynth.stage.request import Request


@pytest.fixture(scope="module")
def shop(tmp_path_factory):
    """A mouth, expressions of the same performer, and a recording with its phones."""
    folder = tmp_path_factory.mktemp("stage")
    corpus = twin_corpus(folder / "actor", sentences=4)
    for name in ("phone_mean", "expression"):
        facesynth.create(name).fit(corpus).save(folder / f"{name}.safetensors")
    speech = corpus[corpus.ids[0]].speech
    save_wav(folder / "clip.wav", speech.audio, speech.sample_rate)
    write_textgrid(folder / "clip.TextGrid", speech.phones)
    return folder, speech


def spoken(shop, **asked):
    folder, speech = shop
    request = Request(expression=folder / "expression.safetensors", **asked)
    return cast_for(load(folder / "phone_mean.safetensors"), request).motion(speech, request, {})


def test_the_mouth_speaks_neutrally_and_the_expression_is_added(shop):
    folder, speech = shop
    request = Request(expression=folder / "expression.safetensors", emotion="sad")
    cast = cast_for(load(folder / "phone_mean.safetensors"), request)
    assert cast.emotions == ("neutral", "happy", "sad")
    sad = EmotionTrack.constant("sad", speech.duration_s)
    said = type(speech)(speech.audio, speech.sample_rate, speech.phones, sad)
    neutral = type(speech)(speech.audio, speech.sample_rate, speech.phones, EmotionTrack.constant("neutral", speech.duration_s))
    added = cast.motion(said, request, {}).frames - cast.mouth.synthesize(neutral).frames
    brows = cast.mouth.fitted_layout.columns("brows")[1::3]
    assert added[:, brows].mean() < -2


def test_an_intensity_of_nothing_is_the_neutral_motion_to_the_byte(shop):
    folder, speech = shop
    none = type(speech)(speech.audio, speech.sample_rate, speech.phones, EmotionTrack.constant("happy", speech.duration_s, 0.0))
    calm = type(speech)(speech.audio, speech.sample_rate, speech.phones, EmotionTrack.constant("neutral", speech.duration_s))
    request = Request(expression=folder / "expression.safetensors", emotion="happy", intensity=0.0)
    cast = cast_for(load(folder / "phone_mean.safetensors"), request)
    plain = cast_for(load(folder / "phone_mean.safetensors"), Request()).motion(calm, Request(), {})
    assert cast.motion(none, request, {}).frames.tobytes() == plain.frames.tobytes()


def test_emotions_that_the_expressions_do_not_know_are_refused(shop):
    with pytest.raises(FacesynthError, match="angry"):
        spoken(shop, emotion="angry")


def test_only_a_model_of_expressions_adds_them_and_it_speaks_not(shop):
    folder, _ = shop
    mouth = load(folder / "phone_mean.safetensors")
    with pytest.raises(FacesynthError, match="moves the mouth; --expression wants a model of the expression"):
        cast_for(mouth, Request(expression=folder / "phone_mean.safetensors"))
    with pytest.raises(FacesynthError, match="give its file with --expression"):
        cast_for(load(folder / "expression.safetensors"), Request())


def test_a_curve_makes_an_emotion_stronger_and_weaker_over_time(tmp_path):
    path = tmp_path / "curve.csv"
    path.write_text("time_s,intensity\n0,0\n1,1\n2,0.5\n")
    track = read_intensity(path).over(EmotionTrack(("sad", "happy"), np.array([1.0, 3.0]), np.array([1.0, 0.5])))
    at = track.intensities[track.index_at([0.01, 0.51, 0.99, 1.99, 2.99])]
    assert at == pytest.approx([0.0, 0.5, 1.0, 0.25, 0.25], abs=0.03)
    assert [track.labels[k] for k in track.index_at([0.99, 1.01])] == ["sad", "happy"]
    assert track.ends_s[-1] == 3


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("t,i\n0,0\n", "wanted the header time_s,intensity"),
        ("time_s,intensity\n", "wanted the header"),
        ("time_s,intensity\n0,much\n", "line 2: wanted two numbers"),
        ("time_s,intensity\n0,1.5\n", "line 2: times rise"),
        ("time_s,intensity\n0,1\n0,0\n", "line 3: times rise"),
        ("time_s,intensity\n0,nan\n", "line 2: times rise"),
    ],
)
def test_curves_that_cannot_be_used_are_refused_in_one_line(tmp_path, text, word):
    (tmp_path / "curve.csv").write_text(text)
    with pytest.raises(FacesynthError, match=word) as told:
        read_intensity(tmp_path / "curve.csv")
    assert "\n" not in str(told.value)


def test_the_command_takes_a_model_of_expressions_and_a_curve(shop, tmp_path):
    try:
        head_folder()
    except ValueError as error:
        pytest.skip(str(error))
    folder, _ = shop
    (tmp_path / "curve.csv").write_text("time_s,intensity\n0,0\n0.5,1\n")
    common = [str(folder / "phone_mean.safetensors"), str(folder / "clip.wav"), "-o", str(tmp_path / "out.npz")]
    felt = ["--expression", str(folder / "expression.safetensors"), "--emotion", "sad"]
    done = CliRunner().invoke(speak, [*common, *felt, "--intensity", str(tmp_path / "curve.csv")], catch_exceptions=False)
    assert done.exit_code == 0
    assert (tmp_path / "out.npz").is_file()
    assert "from 0 to 1" in CliRunner().invoke(speak, [*common, "--intensity", "2"]).output
