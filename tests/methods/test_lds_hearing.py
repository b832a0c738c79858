"""The linear dynamical system that hears with the phone network: in pieces as at once, saved and exported as it was."""

import numpy as np
import pytest
from corpora import tiny_corpus

from facesynth.export.models import export_model
from facesynth.inference.errors import FacesynthError
from facesynth.inference.heard import Listening
from facesynth.inference.heard_input import SIDE_S, HeardInput
from facesynth.inference.loading import load as load_folder
from facesynth.inference.sound import resample
from facesynth.methods.lds.method import LDS
from facesynth.methods.lds.prediction import one_step
from facesynth.speech.phone_archive import is_installed

RNG = np.random.default_rng(5)
needs_weights = pytest.mark.skipif(not is_installed(), reason="the weights that phones are heard with are not installed")


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("lds") / "corpus", utterances=12, fps=50)


@pytest.fixture(scope="module")
def model(corpus):
    return LDS(deterministic_order=3, stochastic_order=2).fit(corpus, seed=0)


def streamed(speaker, sound, cuts, **options):
    stream = speaker.stream(**options)
    return np.concatenate([*(stream.push(piece) for piece in np.split(sound, cuts)), stream.finish()])


def test_a_frame_is_the_sum_of_what_is_heard_around_it():
    heard = RNG.normal(size=(120, 3)).astype(np.float32)
    weights = RNG.normal(size=(5, 3, 2)).astype(np.float32)
    bias, far = np.array([1.0, -2.0], np.float32), np.full(2, 1e9, np.float32)
    given = HeardInput(Listening(lambda sound: sound), 25.0, weights, bias, -far, far)
    got = given.at(heard, 10, 12)
    for frame in (10, 11):
        places = (frame / 25 + np.linspace(-SIDE_S, SIDE_S, 5)) * 100
        wanted = bias + sum(heard[round(place)] @ weights[k] for k, place in enumerate(places))
        np.testing.assert_allclose(got[frame - 10], wanted, rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(given.at(heard[15:], 10, 12, 15), got, rtol=1e-4)
    assert given.first_needed(10) == 20
    assert given.frames_known(61) == 11
    held = HeardInput(given.listening, 25.0, weights, bias, bias, bias)
    assert np.array_equal(held.at(heard, 0, 9), np.tile(bias, (9, 1)))


@needs_weights
def test_what_was_learned_is_nearer_than_the_mean_and_saved_and_exported_the_same(corpus, model, tmp_path):
    speech = corpus[corpus.ids[0]].speech
    errors, still = [], []
    for utterance in corpus:
        frames = utterance.motion.frames
        made = model.synthesize(utterance.speech, noise=0.0).frames[: len(frames)]
        errors.append(np.square(made - frames[: len(made)]).mean())
        still.append(np.square(frames - model.shape.pca.mean.numpy()).mean())
    assert np.mean(errors) < 0.9 * np.mean(still)
    wanted = model.synthesize(speech, seed=3).frames
    model.save(tmp_path / "m.safetensors")
    again = LDS.load(tmp_path / "m.safetensors")
    assert np.array_equal(again.synthesize(speech, seed=3).frames, wanted)
    export_model(tmp_path / "m.safetensors", tmp_path / "folder")
    exported = load_folder(tmp_path / "folder")
    np.testing.assert_allclose(exported.synthesize(speech, seed=3).frames, wanted, atol=2e-3 * np.abs(wanted).max())
    assert exported.look_ahead_s == pytest.approx(model.speaker().look_ahead_s)
    sound = resample(speech.audio, speech.sample_rate, 16000)
    np.testing.assert_allclose(streamed(exported, sound, [999]), streamed(model, sound, [999]), atol=2e-3 * np.abs(wanted).max())
    assert np.isfinite(one_step(model, speech, corpus[corpus.ids[0]].motion.frames)).all()


@needs_weights
def test_it_streams_the_same_however_the_sound_is_cut_and_no_later_than_it_says(model):
    sound = (0.1 * RNG.standard_normal(60000)).astype(np.float32)
    wanted = streamed(model, sound, [], seed=4)
    assert len(wanted) == round(len(sound) / 16000 * 50)
    for cuts in ([1, 8, 168, 20000], np.sort(RNG.integers(0, len(sound), 30))):
        np.testing.assert_allclose(streamed(model, sound, cuts, seed=4), wanted, atol=1e-3)
    stream, given = model.stream(), 0
    for second in range(1, 7):
        given += len(stream.push((0.1 * RNG.standard_normal(16000)).astype(np.float32)))
        assert given >= (second - stream.look_ahead_s) * 50 - 1
    assert len(model.stream().finish()) == 0
    with pytest.raises(FacesynthError, match=r"model\.stream\(\)"):
        model.speaker().advance(model.speaker().start(), sound)


def test_a_model_from_before_there_was_a_choice_hears_as_it_did(corpus, tmp_path):
    model = LDS(hears="periodogram", deterministic_order=2, stochastic_order=2).fit(corpus)
    speech = corpus[corpus.ids[0]].speech
    wanted = model.synthesize(speech).frames
    del model.config["hears"]
    model.save(tmp_path / "m.safetensors")
    again = LDS.load(tmp_path / "m.safetensors")
    assert again.config["hears"] == "both"
    assert np.array_equal(again.synthesize(speech).frames, wanted)
    assert again.listener is None


def test_what_it_cannot_hear_is_refused():
    with pytest.raises(FacesynthError, match="phone_net"):
        LDS(hears="phone_nets")
