"""What recorded faces do beside their lips, and how stretches of it are added."""

import numpy as np
import pytest
from corpora import tiny_corpus

from facesynth.export.models import export_model
from facesynth.inference.filters import gaussian
from facesynth.inference.loading import load as load_folder
from facesynth.inference.residual import ResidualMotion, loudness
from facesynth.inference.speech import EmotionTrack, PhoneTrack, Speech
from facesynth.methods.efase.method import Efase
from facesynth.methods.learn.point_loss import lip_points
from facesynth.methods.learn.residual import Residual, unexplained

RNG = np.random.default_rng(4)


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("residual") / "corpus", utterances=8, fps=50)


def speech_of(level, fps=25.0):
    """Noise that is as loud as [T]."""
    sound = np.repeat(level, round(16000 / fps)) * RNG.standard_normal(len(level) * round(16000 / fps))
    seconds = len(level) / fps
    return Speech(
        sound.astype(np.float32), 16000, PhoneTrack(("aa",), np.array([seconds])), EmotionTrack.constant("neutral", seconds)
    )


def test_loudness_tells_when_a_sound_is_loud_whatever_its_level():
    level = np.where(np.arange(60) // 10 % 2, 0.2, 0.002)
    quiet, loud = (loudness(speech_of(gain * level), 25.0, 60) for gain in (0.05, 1.0))
    assert abs(loud.mean()) < 1e-9
    np.testing.assert_allclose(quiet, loud, atol=0.25)
    assert loud[14] > 0.5
    assert loud[24] < -0.5


def test_what_lips_explain_is_taken_out_and_what_they_do_not_stays():
    lips, own = RNG.normal(size=(500, 2)), RNG.normal(size=500)
    frames = np.column_stack([lips, lips @ [2.0, -1.0], own + lips[:, 0]])
    left = unexplained(frames - frames.mean(axis=0), np.array([0, 1]))
    assert not left[:, :2].any()
    np.testing.assert_allclose(left[:, 2], 0, atol=1e-9)
    assert np.corrcoef(left[:, 3], own)[0, 1] > 0.99


CONTOURS = [0.1 * np.exp(2 * gaussian(RNG.normal(size=80), 4.0)) for _ in range(4)]
"""How loud each of the recordings is."""


def recorded(count=4, length=80, emotions=(0, 0, 1, 1)):
    frames = np.cumsum(RNG.normal(size=(count * length, 2)), axis=0)
    level = np.concatenate([loudness(speech_of(contour), 25.0, length) for contour in CONTOURS])
    return ResidualMotion(frames, np.eye(2, 3), level, length * np.arange(count + 1), np.array(emotions), 25.0)


def test_the_stretch_whose_loudness_is_the_same_is_taken():
    motion = recorded()
    for number in (0, 1):
        track = motion.track(speech_of(CONTOURS[number][10:70]), 0, 25.0, 60)
        begins = [a for a in range(0, 240) if np.allclose(motion.frames[a : a + 50], track[:50, :2], atol=1e-6)]
        assert [a for a in begins if abs(a - 80 * number - 10) <= 2]
        assert not track[:, 2].any()


def test_long_speech_is_filled_without_jumps_and_with_its_emotion():
    motion = recorded()
    track = motion.track(speech_of(0.1 * RNG.random(1000)), 1, 25.0, 1000)
    assert track.shape == (1000, 3)
    usual = np.linalg.norm(np.diff(motion.frames, axis=0), axis=1).max()
    assert np.linalg.norm(np.diff(track, axis=0), axis=1).max() < 3 * usual
    own = motion.frames[160:].astype(np.float32)
    found = [np.abs(own - track[t, :2]).sum(axis=1).min() < 1e-4 for t in range(0, 50)]
    assert all(found)


@pytest.mark.parametrize("count", [1, 2, 3, 11])
def test_the_shortest_speech_and_the_shortest_recordings_do(count):
    short = ResidualMotion(np.ones((2, 2)), np.eye(2), np.zeros(2), np.array([0, 2]), np.array([0]), 25.0)
    track = short.track(speech_of(np.full(count, 0.1)), 3, 60.0, count)
    np.testing.assert_allclose(track, 1.0)


def test_lips_stay_as_they_are_and_the_rest_moves_more(corpus):
    still = Efase().fit(corpus)
    lively = Efase(residual=1.0).fit(corpus)
    speech = corpus[corpus.ids[0]].speech
    before, after = still.synthesize(speech).points, lively.synthesize(speech).points
    lips = lip_points(corpus.layout)
    others = np.setdiff1d(np.arange(len(corpus.layout.names)), lips)
    assert np.array_equal(before[:, lips], after[:, lips])
    speed = [np.linalg.norm(np.diff(points[:, others], axis=0), axis=2).mean() for points in (before, after)]
    assert speed[1] > speed[0]


def test_saved_and_exported_it_moves_the_same(corpus, tmp_path):
    from facesynth.methods.registry import load

    speech = corpus[corpus.ids[1]].speech
    model = Efase(residual=0.7).fit(corpus)
    wanted = model.synthesize(speech).frames
    model.save(tmp_path / "efase.safetensors")
    assert np.array_equal(load(tmp_path / "efase.safetensors").synthesize(speech).frames, wanted)
    export_model(tmp_path / "efase.safetensors", tmp_path / "folder")
    np.testing.assert_allclose(load_folder(tmp_path / "folder").synthesize(speech).frames, wanted, atol=1e-3)


def test_layouts_without_lips_keep_nothing_and_say_why(corpus):
    from dataclasses import replace

    class Curves:
        layout = replace(corpus.layout, groups={})

    residual = Residual()
    assert "no lips" in residual.learn(Curves())
    assert residual.motion(25.0, 1.0) is None
