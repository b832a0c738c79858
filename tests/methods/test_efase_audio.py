"""eFASE that hears: audio terms, the expected pose, sharpening, and learning through the soft search."""

import mmap
import shutil
from dataclasses import replace

import numpy as np
import pytest
import torch
from corpora import tiny_corpus
from scipy.ndimage import gaussian_filter1d

from facesynth.config import load_config
from facesynth.corpus import Corpus
from facesynth.evaluation.dynamics import energy_ratio
from facesynth.evaluation.geometry import marker_error
from facesynth.inference import long_arrays
from facesynth.inference.efase import hearing as listening
from facesynth.inference.efase.assembly import Smoothing, concatenate
from facesynth.inference.efase.hearing import PoseDistances
from facesynth.inference.errors import FacesynthError
from facesynth.inference.filters import sharpen
from facesynth.inference.motion import Motion
from facesynth.methods.efase import shares
from facesynth.methods.efase.learning import lattices_of, learn, logs_of, mean_error, pose_differences
from facesynth.methods.efase.method import Efase
from facesynth.methods.learn import descent
from facesynth.methods.learn import expectation as prediction
from facesynth.methods.learn.descent import Logs, descend
from facesynth.methods.learn.sharpening import matching_share
from facesynth.methods.registry import load
from facesynth.methods.training import train


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
    sounds, nodes = hearing.audio.sound.sounds(), hearing.audio.sound.nodes.numpy().astype(np.float64)
    heard = sounds.of(hearing.audio.sound.hearing.bands(utterance.speech), utterance.speech.phones)
    spoken = [i for i, label in enumerate(utterance.speech.phones.labels) if label != "pau"]
    names = [f"{utterance.id}:{i}" for i in spoken]
    distances = sounds.distances(heard[spoken])
    places = [hearing.facts["names"].index(name) for name in names]
    np.testing.assert_allclose(distances[np.arange(len(spoken)), places], 0, atol=1e-4)
    pairs = sounds.distances(nodes)
    assert pairs[~np.eye(len(nodes), dtype=bool)].mean() == pytest.approx(2, rel=0.05)


def test_costs_in_a_file_and_some_phones_at_a_time_are_the_same(hearing, speech, monkeypatch):
    whole, plan = hearing.asked(speech)[1], hearing.plan(speech)
    for module, name, least in ((long_arrays, "LARGE_BYTES", 1), (listening, "TOGETHER_BYTES", 3 * whole.costs[:1].nbytes)):
        monkeypatch.setattr(module, name, least)
    pieces = hearing.asked(speech)[1]
    assert isinstance(pieces.costs.base.base.obj, mmap.mmap)
    np.testing.assert_allclose(pieces.costs, whole.costs, rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(hearing.plan(speech).nodes, plan.nodes)


def test_the_audio_term_draws_the_path_to_nodes_that_sound_alike(hearing, speech):
    query, heard = hearing.asked(speech)
    spoken = query.phones >= 0
    distances = hearing.audio.sound.sounds().distances(heard.sounds)

    def mean_distance(weight):
        nodes = hearing.with_weights(audio_weight=weight, pose_weight=0.0, temperature=0.0).plan(speech).nodes
        return distances[spoken, nodes[spoken]].mean()

    assert mean_distance(50.0) < mean_distance(0.01)


def test_the_pose_term_draws_motion_to_what_is_expected(hearing, speech):
    def distance(weight):
        model = hearing.with_weights(pose_weight=weight, audio_weight=0.0, temperature=0.0)
        plan, bounds = model.plan(speech), speech.phones.frame_bounds(120)
        rest = np.zeros((len(plan.nodes), plan.expected.shape[1]))
        made = concatenate(model.nodes(), plan.nodes, speech.phones.labels, bounds, rest, 120, Smoothing(stiffness=0))
        spoken = np.repeat(plan.nodes >= 0, np.diff(bounds))
        return ((made - plan.expected)[spoken] ** 2).sum(axis=1).mean()

    assert distance(100.0) < distance(1e-6)


@pytest.mark.parametrize("count", [1, 2, 5, 40])
def test_pose_costs_of_all_nodes_are_those_of_stretched_motion(hearing, count):
    nodes, rng = hearing.nodes(), np.random.default_rng(count)
    poses, metric = rng.normal(size=(count, nodes.frames.shape[1])), rng.uniform(0, 2, nodes.frames.shape[1])
    wanted = pose_differences(nodes, np.arange(len(nodes)), poses) @ metric
    np.testing.assert_allclose(PoseDistances(nodes, metric).of([poses])[0], wanted, rtol=1e-9)


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


def test_a_share_of_the_pose_is_the_expected_one(hearing, speech):
    def posed(share):
        speaker = hearing.with_weights(expected_share=share).speaker
        plan, labels = speaker.plan(speech), speech.phones.labels
        feelings, bounds = speech.emotions.per_phone(speech.phones)[0], speech.phones.frame_bounds(speaker.database_fps)
        return speaker.coordinates(plan, labels, feelings, bounds), plan.expected

    found, expected = posed(0.0)
    assert np.abs(found - expected).max() > 1
    np.testing.assert_allclose(posed(0.25)[0], 0.75 * found + 0.25 * expected, atol=1e-9)
    np.testing.assert_allclose(posed(1.0)[0], expected, atol=1e-9)


def posed(model, speech):
    """What a model shows, what its search finds and what it expects, [T, D] each."""
    speaker, labels = model.speaker, speech.phones.labels
    about = labels, speech.emotions.per_phone(speech.phones)[0], speech.phones.frame_bounds(model.speaker.database_fps)
    plan = speaker.plan(speech)
    return speaker.coordinates(plan, *about), speaker.found(plan, *about), plan.expected


def test_each_component_has_its_own_shares_of_what_is_found_and_expected(hearing, speech, tmp_path):
    model = hearing.with_weights(expected_share=0.25)
    one, found, expected = posed(model, speech)
    count = found.shape[1]
    model.set_shares([[0.75] * count, [0.25] * count])
    np.testing.assert_allclose(posed(model, speech)[0], one, atol=1e-9)
    own, others = np.linspace(0, 1.5, count), np.linspace(1, -0.5, count)
    model.set_shares([own.tolist(), others.tolist()])
    shown = posed(model, speech)[0]
    np.testing.assert_allclose(shown, own * found + others * expected, atol=1e-4)
    np.testing.assert_allclose(shown[:, 0], expected[:, 0], atol=1e-9)
    model.save(tmp_path / "shares.safetensors")
    np.testing.assert_array_equal(posed(load(tmp_path / "shares.safetensors"), speech)[0], shown)
    np.testing.assert_array_equal(posed(model.with_weights(candidates=30), speech)[0], shown)
    np.testing.assert_allclose(posed(model.with_weights(expected_share=1.0), speech)[0], expected, atol=1e-9)


def test_shares_are_those_that_recordings_were_made_of(hearing, halves, monkeypatch):
    model = hearing.with_weights(expected_share=0.5)
    fps, made = model.speaker.database_fps, []
    own, others = np.linspace(0.2, 1.1, model.pca.basis.shape[1]), np.linspace(0.9, 0.4, model.pca.basis.shape[1])
    for utterance in list(halves[1])[:4]:
        _, found, expected = posed(model, utterance.speech)
        frames = model.pca.decode(torch.from_numpy(own * found + others * expected).float()).numpy()
        frames[3] = np.nan
        made.append(replace(utterance, motion=Motion(frames, fps, model.fitted_layout)))
    monkeypatch.setattr(shares, "PENALTY_S", 0.0)
    np.testing.assert_allclose(shares.learned_shares(model, made), [own, others], atol=0.02)
    monkeypatch.setattr(shares, "PENALTY_S", 1e9)
    np.testing.assert_allclose(shares.learned_shares(model, made), 0.5, atol=1e-6)


@pytest.mark.parametrize("settings", [{"expected_share": 1.1, "pose_weight": 1.0}, {"expected_share": 0.5}])
def test_a_share_of_what_nobody_expects_is_refused(settings):
    with pytest.raises(FacesynthError, match="expected_share"):
        Efase(**settings)


def test_a_model_without_ears_cannot_be_made_to_hear(halves):
    with pytest.raises(FacesynthError, match="above 0"):
        Efase().fit(halves[0]).with_weights(pose_weight=1.0)


def test_the_prediction_repeats_by_seed_and_leaves_torch_alone(halves, monkeypatch):
    monkeypatch.setattr(prediction, "STEPS", 3)
    weights = []
    state = torch.random.get_rng_state()
    for seed in (0, 0, 1):
        model = Efase(pose_weight=1.0).fit(halves[0].subset(halves[0].ids[:4]), seed=seed)
        weights.append(model.audio.predictor.network.first.weight)
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
    lattices, logs = lattices_of(hearing, next(iter(halves[1]))), logs_of(hearing)
    lattices[0].truth[3:6] = torch.nan  # a gap
    mean_error(lattices, logs).backward()
    moved = [(logs.numbers, place) for place in np.flatnonzero(logs.used)]
    moved += [(logs.factors["sound"], 0), (logs.factors["sound"], 3), (logs.factors["pose"], 0), (logs.factors["pose"], 1)]
    for leaf, place in moved:
        slopes = []
        for step in (1e-4, -1e-4):
            with torch.no_grad():
                leaf[place] += step
                slopes.append(float(mean_error(lattices, logs)))
                leaf[place] -= step
        assert float(leaf.grad[place]) == pytest.approx((slopes[0] - slopes[1]) / 2e-4, rel=1e-3, abs=1e-8)


def test_a_move_away_from_the_start_costs():
    def error_of(examples, logs):
        return torch.stack([(logs.values()["size"] - wanted) ** 2 for wanted in examples]).mean()

    found = {}
    for pull in (0.0, 0.1, 10.0):
        logs = Logs({"size": 1.0, "none": 0.0}, {"factors": 2})
        errors = descend(logs, error_of, [3.0] * 8, [3.0], seed=0, rounds=60, pull=pull)
        assert min(errors) == pytest.approx((logs.found()["size"] - 3) ** 2)
        found[pull] = logs.found()["size"]
        assert logs.found()["none"] == 0
    assert found[0.0] == pytest.approx(3, abs=0.2)
    assert found[0.0] > found[0.1] > found[10.0] > 1


def test_learning_stops_where_unknown_examples_get_worse():
    def error_of(examples, logs):
        return torch.stack([(logs.values()["size"] - wanted) ** 2 + 0.01 for wanted in examples]).mean()

    logs = Logs({"size": 1.0}, {})
    errors = descend(logs, error_of, [3.0] * 8, [1.2], seed=0, rounds=60, pull=0.0)
    assert len(errors) < 30
    assert logs.found()["size"] == pytest.approx(1.2, abs=0.06)


def test_the_parts_share_no_sentence(halves):
    corpus = halves[0]
    key = {record.id: record.sentence_key for record in corpus.usable_records}
    parts = [{key[i] for i in part.ids} for part in descent.three_parts(corpus, 3)]
    assert sum(map(len, parts)) == len(set.union(*parts)) == len(set(key.values()))
    again = descent.three_parts(corpus, 3)
    assert [part.ids for part in again] == [part.ids for part in descent.three_parts(corpus, 3)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(descent, "MOST", 1)
        some = descent.three_parts(corpus, 3)
        assert [len(part.ids) for part in some][1:] == [1, 1]
        assert len({key[i] for i in some[0].ids} | {key[i] for part in some[1:] for i in part.ids}) == len(set(key.values()))
        assert not {key[i] for i in some[0].ids} & {key[i] for part in some[1:] for i in part.ids}


@pytest.fixture(scope="module")
def learned(halves):
    settings = {"audio_weight": 0.2, "temperature": 2.0, "candidates": 20, "sharpening": 0.5}
    return settings, learn(halves[0], settings, seed=0, rounds=3)


def test_learning_does_not_make_the_held_out_error_larger_and_repeats(halves, learned):
    settings, found = learned
    assert len(found.errors) == 4
    assert 0 <= found.improvement < 1
    assert all(value >= 0 for value in found.settings.values())
    assert learn(halves[0], settings, seed=0, rounds=3) == found


def _with_others_spoilt(halves, path):
    """The first half, in a copy of the corpus whose other half moves otherwise."""
    shutil.copytree(halves[0].path, path)
    rng = np.random.default_rng(9)
    for utterance_id in halves[1].ids:
        with np.load(path / "motion" / f"{utterance_id}.npz") as file:
            arrays = dict(file)
        arrays["frames"] = rng.normal(0, 50, arrays["frames"].shape).astype(np.float32)
        np.savez(path / "motion" / f"{utterance_id}.npz", **arrays)
    spoilt = Corpus.open(path)
    assert not np.array_equal(spoilt[halves[1].ids[0]].motion.frames, halves[1][halves[1].ids[0]].motion.frames)
    return spoilt.subset(halves[0].ids)


def test_fitting_learns_from_its_own_corpus_alone_and_keeps_what_it_found(halves, tmp_path):
    settings = {"audio_weight": 0.2, "temperature": 2.0, "candidates": 20}
    wanted = learn(_with_others_spoilt(halves, tmp_path / "spoilt"), settings, seed=4)
    model = train(Efase, halves[0], {**settings, "learn": True}, seed=4)
    assert {name: model.config[name] for name in wanted.settings} == wanted.settings
    assert model.facts["learned"]["improvement"] == wanted.improvement
    plain = Efase(**{**settings, **wanted.settings}).fit(halves[0], seed=4)
    torch.testing.assert_close(model.audio.sound.nodes, plain.audio.sound.nodes * torch.tensor(wanted.sound_metric).sqrt())
    model.save(tmp_path / "learned.safetensors")
    utterance = next(iter(halves[1]))
    made = load(tmp_path / "learned.safetensors").synthesize(utterance.speech)
    assert made.frames.tobytes() == model.synthesize(utterance.speech).frames.tobytes()
    assert np.isfinite(marker_error(made, utterance.motion))


def test_training_learns_shares_where_expected_poses_are_shown(halves, tmp_path, monkeypatch):
    monkeypatch.setattr(prediction, "STEPS", 3)
    settings = {"pose_weight": 0.5, "expected_share": 0.5, "temperature": 1.0, "candidates": 10, "components": 5, "learn": True}
    model = train(Efase, halves[0].subset(halves[0].ids[:10]), settings, seed=4)
    assert model.shares.shape == (2, 5)
    assert not np.allclose(model.shares, 0.5, atol=0.01)
    assert "shares" not in model.facts["learned"]
    model.save(tmp_path / "learned.safetensors")
    np.testing.assert_array_equal(load(tmp_path / "learned.safetensors").shares, model.shares)


def test_the_sharpening_that_recordings_ask_for_is_found(halves):
    truth = next(iter(halves[1])).motion
    slow = replace(truth, frames=gaussian_filter1d(truth.frames, 0.05 * truth.fps, axis=0))
    assert matching_share([(truth, truth)]) == 0
    share = matching_share([(slow, truth)])
    assert 0 < share < 2
    for other, direction in ((share + 0.2, 1), (max(share - 0.2, 0), -1)):
        moves = [np.abs(np.diff(sharpen(slow.frames.astype(float), s, truth.fps), axis=0)).mean() for s in (other, share)]
        assert np.sign(moves[0] - moves[1]) == direction
    raised = replace(slow, frames=sharpen(slow.frames.astype(float), share, truth.fps).astype(np.float32))
    assert matching_share([(raised, truth)]) < 0.5 * share
    noisy = replace(truth, frames=truth.frames + np.random.default_rng(0).normal(0, 0.02, truth.frames.shape).astype(np.float32))
    assert matching_share([(slow, noisy)]) == pytest.approx(share, abs=0.1)
    gap = replace(truth, frames=np.where(np.arange(len(truth.frames))[:, None] < 5, np.float32(np.nan), truth.frames))
    assert matching_share([(slow, gap)]) == pytest.approx(share, abs=0.2)


def test_learning_refuses_what_it_cannot_learn_from(halves):
    with pytest.raises(FacesynthError, match="temperature"):
        learn(halves[0], {})
    with pytest.raises(FacesynthError, match="at least 10"):
        learn(halves[0].subset(halves[0].ids[:3]), {"temperature": 1.0})


def test_the_shipped_soft_settings_are_settings_of_efase(repository):
    config = Efase.from_config(load_config(repository / "configs" / "efase_soft.yaml")).config
    assert config["temperature"] > 0
    assert config["pose_weight"] > 0
    assert config["learn"]
    defaults = Efase.from_config(load_config(repository / "configs" / "efase.yaml")).config
    assert {key: value for key, value in config.items() if value != defaults[key]} == Efase.capabilities.nearest
    still = Efase.from_config(load_config(repository / "configs" / "efase_soft_still.yaml")).config
    assert still == {**config, "sharpening": 0.0, "residual": 0.0}


@pytest.mark.parametrize("method", ["efase", "anime_graph"])
def test_the_training_scripts_learn_weights(method, tmp_path, script):
    corpus = tiny_corpus(tmp_path / "actor", utterances=24, fps=60)
    model = tmp_path / "learned.safetensors"
    settings = ["learn=true", "temperature=1", "audio_weight=0.3", "sharpening=0.5"]
    settings += ["candidates=10"] if method == "efase" else []
    said = script(f"{method}.py", corpus.path, "-o", model, *settings)
    assert "validation error" in said
    assert "audio_weight=" in said
    found = load(model).config
    assert found["audio_weight"] != 0.3
    assert found["sharpening"] != 0.5
    assert f"audio_weight={found['audio_weight']:.4g}" in said
