"""eFASE that hears: audio terms, the expected pose, sharpening, and learning through the soft search."""

import subprocess
import sys

import numpy as np
import pytest
import torch
from corpora import tiny_corpus

from facesynth.config import load_config
from facesynth.errors import FacesynthError
from facesynth.evaluation.dynamics import energy_ratio
from facesynth.evaluation.geometry import marker_error
from facesynth.methods.efase import learning, prediction
from facesynth.methods.efase.audio import sound_distances
from facesynth.methods.efase.concatenation import Smoothing, concatenate
from facesynth.methods.efase.learning import _Parameters, apply, lattices_of, learn, mean_error
from facesynth.methods.efase.method import Efase
from facesynth.methods.efase.sharpening import sharpen
from facesynth.methods.registry import load


@pytest.fixture(scope="module")
def halves(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("hearing") / "corpus", utterances=28, fps=60).split(0)


@pytest.fixture(scope="module")
def hearing(halves):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(prediction, "STEPS", 12)
        return Efase(audio_weight=0.2, pose_weight=0.5, temperature=0.3, candidates=30).fit(halves[0], seed=1)


@pytest.fixture
def speech(halves):
    return next(iter(halves[1])).speech


def test_a_recorded_sentence_sounds_like_itself(hearing, halves):
    utterance = next(iter(halves[0]))
    sounds = hearing.audio.sound.of(utterance.speech)
    nodes = hearing.audio.sound.nodes.numpy().astype(np.float64)
    spoken = [i for i, label in enumerate(utterance.speech.phones.labels) if label != "pau"]
    names = [f"{utterance.id}:{i}" for i in spoken]
    distances = sound_distances(sounds[spoken], nodes)
    places = [hearing.facts["names"].index(name) for name in names]
    np.testing.assert_allclose(distances[np.arange(len(spoken)), places], 0, atol=1e-4)
    pairs = sound_distances(nodes, nodes)
    assert pairs[~np.eye(len(nodes), dtype=bool)].mean() == pytest.approx(2, rel=0.05)


def test_the_audio_term_draws_the_path_to_nodes_that_sound_alike(hearing, speech):
    query, expected = hearing.asked(speech)
    spoken = query.phones >= 0
    distances = sound_distances(expected.sounds, hearing.audio.sound.nodes.numpy().astype(np.float64))

    def mean_distance(weight):
        nodes = hearing.with_weights(audio_weight=weight, pose_weight=0.0, temperature=0.0).plan(speech).nodes
        return distances[spoken, nodes[spoken]].mean()

    assert mean_distance(50.0) < mean_distance(0.01)


def test_the_pose_term_draws_motion_to_what_is_expected(hearing, speech):
    def distance(weight):
        model = hearing.with_weights(pose_weight=weight, audio_weight=0.0, temperature=0.0)
        plan, bounds = model.plan(speech), speech.phones.frame_bounds(120)
        rest = model.rest_of(speech)
        made = concatenate(model.nodes(), plan.nodes, speech.phones.labels, bounds, rest, 120, Smoothing(stiffness=0))
        spoken = np.repeat(plan.nodes >= 0, np.diff(bounds))
        return ((made - plan.expected)[spoken] ** 2).sum(axis=1).mean()

    assert distance(100.0) < distance(1e-6)


def test_silence_follows_what_is_expected_without_a_jump(hearing):
    nodes = hearing.nodes()
    rng = np.random.default_rng(0)
    bounds, phones = np.array([0, 60, 72, 160]), ("pau", "aa", "pau")
    expected = np.cumsum(rng.normal(size=(160, nodes.frames.shape[1])), axis=0) * 0.01
    made = concatenate(
        nodes, np.array([-1, 3, -1]), phones, bounds, np.zeros((3, 1)) + expected[:3], 120, Smoothing(), None, expected
    )
    np.testing.assert_allclose(made[:30], expected[:30])
    np.testing.assert_allclose(made[110:], expected[110:])
    steps = np.abs(np.diff(made, axis=0)).max(axis=1)
    inside = np.abs(np.diff(nodes.motion(3), axis=0)).max()
    assert steps[[59, 71]].max() < max(inside, steps[:40].max()) + 0.15 * np.abs(made[60] - expected[60]).max()


def test_what_is_heard_survives_saving_and_repeats(hearing, halves, speech, tmp_path):
    hearing.save(tmp_path / "hearing.safetensors")
    first = hearing.synthesize(speech).frames.tobytes()
    assert load(tmp_path / "hearing.safetensors").synthesize(speech).frames.tobytes() == first
    deaf = hearing.with_weights(audio_weight=0.0, pose_weight=0.0)
    deaf.save(tmp_path / "deaf.safetensors")
    assert load(tmp_path / "deaf.safetensors").plan(speech).expected is None


def test_a_model_without_ears_cannot_be_made_to_hear(halves):
    with pytest.raises(FacesynthError, match="above 0"):
        Efase().fit(halves[0]).with_weights(pose_weight=1.0)


def test_the_prediction_repeats_by_seed_and_leaves_torch_alone(halves, monkeypatch):
    monkeypatch.setattr(prediction, "STEPS", 3)
    weights = []
    state = torch.random.get_rng_state()
    for seed in (0, 0, 1):
        model = Efase(pose_weight=1.0).fit(halves[0].subset(halves[0].ids[:4]), seed=seed)
        weights.append(model.audio.predictor.network[0].weight)
    assert torch.equal(weights[0], weights[1])
    assert not torch.equal(weights[0], weights[2])
    assert torch.equal(state, torch.random.get_rng_state())


def test_sharpening_adds_motion_and_leaves_a_held_pose(hearing, halves, speech):
    held = np.ones((40, 2))
    np.testing.assert_allclose(sharpen(held, 1.0, 60), held)
    noise = np.random.default_rng(0).normal(size=(2000, 1))
    slow = np.sin(np.arange(2000) / 120 * 2 * np.pi * 3)[:, None]
    assert np.abs(np.diff(sharpen(noise, 1.0, 120), 3, axis=0)).mean() < np.abs(np.diff(noise, 3, axis=0)).mean()
    assert np.ptp(sharpen(slow, 1.0, 120)[200:-200]) > 1.4 * np.ptp(slow)
    np.testing.assert_array_equal(sharpen(noise, 0.0, 120), noise)
    utterance = next(iter(halves[1]))
    energies = [energy_ratio(hearing.with_weights(sharpening=s).synthesize(speech), utterance.motion) for s in (0.0, 0.5, 1.0)]
    assert energies[0] < energies[1] < energies[2]


def test_the_gradient_of_the_error_is_that_of_small_steps(hearing, halves):
    lattices = lattices_of(hearing, next(iter(halves[1])))
    parameters = _Parameters(hearing)

    def error():
        return mean_error(lattices, parameters.values(), parameters.sound, parameters.pose)

    error().backward()
    for leaf, place in ((parameters.numbers, 2), (parameters.numbers, 8), (parameters.sound, 0), (parameters.pose, 0)):
        slopes = []
        for step in (1e-4, -1e-4):
            with torch.no_grad():
                leaf[place] += step
                slopes.append(float(error()))
                leaf[place] -= step
        assert float(leaf.grad[place]) == pytest.approx((slopes[0] - slopes[1]) / 2e-4, rel=1e-3, abs=1e-8)


@pytest.fixture(scope="module")
def learned(halves):
    settings = {"audio_weight": 0.2, "temperature": 2.0, "candidates": 20}
    return settings, learn(halves[0], settings, seed=0, rounds=3)


def test_learning_does_not_make_the_held_out_error_larger_and_repeats(halves, learned):
    settings, found = learned
    assert len(found.errors) == 4
    assert 0 <= found.improvement < 1
    assert all(value >= 0 for value in found.settings.values())
    assert learn(halves[0], settings, seed=0, rounds=3) == found


def test_what_was_learned_goes_into_a_model(halves, learned, tmp_path):
    settings, found = learned
    model = Efase.from_config({**settings, **found.settings}).fit(halves[0])
    before = model.audio.sound.nodes.clone()
    apply(found, model)
    torch.testing.assert_close(model.audio.sound.nodes, before * torch.tensor(found.sound_metric).sqrt())
    model.save(tmp_path / "learned.safetensors")
    utterance = next(iter(halves[1]))
    made = load(tmp_path / "learned.safetensors").synthesize(utterance.speech)
    assert np.isfinite(marker_error(made, utterance.motion))


def test_learning_refuses_what_it_cannot_learn_from(halves):
    with pytest.raises(FacesynthError, match="temperature"):
        learn(halves[0], {})
    with pytest.raises(FacesynthError, match="at least 10"):
        learn(halves[0].subset(halves[0].ids[:3]), {"temperature": 1.0})
    shares = learning.DATABASE_SHARE, learning.LEARN_SHARE
    assert sum(shares) < 1


def test_the_shipped_soft_settings_are_settings_of_efase(repository):
    config = Efase.from_config(load_config(repository / "configs" / "efase_soft.yaml")).config
    assert config["temperature"] > 0
    assert config["pose_weight"] > 0


def test_the_training_script_learns_weights(tmp_path, repository):
    corpus = tiny_corpus(tmp_path / "actor", utterances=40, fps=60)
    model = tmp_path / "learned.safetensors"
    command = [sys.executable, str(repository / "train" / "efase.py"), str(corpus.path), "-o", str(model)]
    command += ["learn=true", "temperature=1", "audio_weight=0.3", "candidates=10"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr
    assert "validation error" in done.stdout
    assert "penalty=" in done.stdout
    assert load(model).config["temperature"] > 0
