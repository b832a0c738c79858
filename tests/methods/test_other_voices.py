"""Sounds as other people, microphones and rooms would have made them, and what a network learns from them."""

import numpy as np
import pytest
from corpora import tiny_corpus

from facesynth.export.models import export_model
from facesynth.inference.errors import FacesynthError
from facesynth.inference.expectation import Reading, Said, Standard
from facesynth.inference.loading import load as load_folder
from facesynth.inference.phones import PHONE_INDEX
from facesynth.methods.learn import windows
from facesynth.methods.learn.other_voices import RATE, other_voice
from facesynth.methods.learn.windows import Recording, Windows
from facesynth.methods.network.method import Network
from facesynth.speech.phone_archive import is_installed

needs_weights = pytest.mark.skipif(not is_installed(), reason="the weights that phones are heard with are not installed")


def click_at(seconds, length=2.0):
    sound = np.zeros(round(length * RATE), np.float32)
    at = round(seconds * RATE)
    sound[at : at + 160] = 0.8 * np.hanning(160)
    return sound


def test_what_is_heard_lies_where_it_came_from_and_is_changed_in_level_and_speed():
    speeds, peaks = [], []
    for seed in range(40):
        changed, speed = other_voice(click_at(1.3), np.random.default_rng(seed))
        assert np.isfinite(changed).all()
        assert np.abs(changed).max() <= 1
        heard_s = np.abs(changed).argmax() / RATE
        assert heard_s * speed == pytest.approx(1.3, abs=0.02)
        assert len(changed) * speed == pytest.approx(2.0 * RATE, abs=1)
        speeds, peaks = [*speeds, speed], [*peaks, np.abs(changed).max()]
    assert min(speeds) < 0.9
    assert max(speeds) > 1.1
    assert 20 * np.log10(max(peaks) / min(peaks)) > 20


def test_the_same_seed_changes_a_sound_in_the_same_way():
    one, two, other = (other_voice(click_at(0.5), np.random.default_rng(seed))[0] for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, two)
    assert one.shape != other.shape or not np.array_equal(one, other)


def recording(level, *others):
    said = Said.numbered([PHONE_INDEX["aa"]], np.array([4.0]), [0], 1)
    heard = [np.full((400, 2), value, np.float32) for value in (level, *others)]
    return Recording(heard[0], tuple(heard[1:]), said, np.zeros((100, 1), np.float32), np.ones(100, np.float32), 25.0)


def test_windows_come_from_all_sounds_and_some_are_not_told_what_is_said(monkeypatch):
    monkeypatch.setattr(windows, "MASK_SHARE", 0.0)
    reading = Reading(Standard(np.zeros(2, np.float32), np.ones(2, np.float32)), 25.0, phones=True, emotion_count=1)
    drawn = [
        Windows([recording(0.0, 50.0, 100.0)], reading, 0, unsaid=0.3).draw(np.random.default_rng(seed)) for seed in range(20)
    ]
    told = np.concatenate([batch.told.numpy() for batch in drawn])
    levels, counts = np.unique(np.round(told[:, :, :8].mean(axis=(1, 2)) / 50), return_counts=True)
    assert list(levels) == [0, 1, 2]
    assert counts.min() > 0.25 * counts.sum()
    silent = (told[:, :, 8 : 8 + reading.said_width] == 0).all(axis=(1, 2))
    assert 0.2 < silent.mean() < 0.4


@needs_weights
def test_a_network_that_hears_with_the_phone_network_speaks_from_its_folder(tmp_path):
    corpus = tiny_corpus(tmp_path / "corpus", utterances=3, fps=50)
    model = Network(steps=2, features="phone_net", voices=1, unsaid=0.5, phones=False).fit(corpus, seed=0)
    model.save(tmp_path / "net.safetensors")
    export_model(tmp_path / "net.safetensors", tmp_path / "net")
    speech = corpus[corpus.ids[0]].speech
    wanted, folder = model.synthesize(speech).frames, load_folder(tmp_path / "net")
    np.testing.assert_allclose(folder.synthesize(speech).frames, wanted, atol=1e-4 * np.abs(wanted).max())


@needs_weights
def test_the_same_seed_changes_sounds_alike_and_gives_the_same_file(tmp_path):
    corpus = tiny_corpus(tmp_path / "corpus", utterances=3, fps=50)
    for name in ("one", "two"):
        Network(steps=2, features="phone_net", voices=1, unsaid=0.5).fit(corpus, seed=4).save(tmp_path / name)
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()


def test_a_share_that_is_none_is_refused():
    with pytest.raises(FacesynthError, match="unsaid"):
        Network(unsaid=1.5)
    with pytest.raises(FacesynthError, match="voices"):
        Network(voices=-1)
