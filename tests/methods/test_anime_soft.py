"""The soft search of the anime graph against all paths; the expected pose, sharpening and learning."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
import torch
from corpora import tiny_corpus
from test_anime_search import random_steps

from facesynth.config import load_config
from facesynth.evaluation.dynamics import energy_ratio
from facesynth.inference.anime_graph.assembly import make_piece, mean_motion
from facesynth.inference.anime_graph.candidates import pose_costs, stretched_motions
from facesynth.inference.anime_graph.search import Weights, best_path, path_cost, soft_path
from facesynth.inference.errors import FacesynthError
from facesynth.inference.warp import time_warp
from facesynth.methods.anime_graph.learning import NUMBERS, lattice_of, learn, mean_error
from facesynth.methods.anime_graph.method import AnimeGraph
from facesynth.methods.learn import expectation as prediction
from facesynth.methods.learn.descent import Logs
from facesynth.methods.registry import load
from facesynth.methods.training import train

WEIGHTS = Weights(20.0, 1.0, 0.05, 3.0)
SOFT = {"jump_weight": 10.0, "jump_cost_weight": 3.0, "audio_weight": 1.5, "pose_weight": 5.0, "temperature": 2.0}
FAST = {"map_width": "median", "map_centres": 20}


def steps_of(seed, length, *, posed, **more):
    rng = np.random.default_rng(seed)
    steps = random_steps(seed, length, **more)
    return [replace(step, pose=rng.exponential(5, len(step.audio))) for step in steps] if posed else steps


@pytest.mark.parametrize("posed", [False, True])
@pytest.mark.parametrize("temperature", [0.5, 10.0, 500.0])
@pytest.mark.parametrize("seed", range(6))
def test_equals_the_enumeration_of_all_paths(seed, temperature, posed):
    steps = steps_of(seed, 5, posed=posed)
    paths = np.array(list(itertools.product(*(range(len(s.audio)) for s in steps))))
    costs = np.array([path_cost(steps, path, WEIGHTS) for path in paths])
    shares = np.exp(-(costs - costs.min()) / temperature)
    shares /= shares.sum()
    for t, found in enumerate(soft_path(steps, WEIGHTS, temperature)):
        np.testing.assert_allclose(found, np.bincount(paths[:, t], shares, len(found)), atol=1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_the_expected_pose_is_part_of_the_exact_search(seed):
    steps = steps_of(seed, 5, posed=True)
    paths = np.array(list(itertools.product(*(range(len(s.audio)) for s in steps))))
    bare = [replace(step, pose=None) for step in steps]
    poses = [sum(step.pose[c] for step, c in zip(steps, path, strict=True)) for path in paths]
    costs = [path_cost(bare, path, WEIGHTS) + WEIGHTS.pose * pose for path, pose in zip(paths, poses, strict=True)]
    path, cost = best_path(steps, WEIGHTS)
    assert cost == pytest.approx(min(costs))
    np.testing.assert_array_equal(path, paths[int(np.argmin(costs))])


@pytest.mark.parametrize("posed", [False, True])
@pytest.mark.parametrize("seed", range(6))
def test_cold_it_is_the_cheapest_path(seed, posed):
    steps = steps_of(seed, 8, posed=posed, most=6)
    found = soft_path(steps, WEIGHTS, 1e-6)
    np.testing.assert_array_equal([shares.argmax() for shares in found], best_path(steps, WEIGHTS)[0])
    assert min(shares.max() for shares in found) > 1 - 1e-9


def test_no_temperature():
    with pytest.raises(FacesynthError, match="above 0"):
        soft_path(random_steps(0, 3), WEIGHTS, 0.0)


@pytest.mark.parametrize("setting", ["temperature", "pose_weight", "sharpening"])
def test_settings_without_meaning(setting):
    with pytest.raises(FacesynthError, match=setting):
        AnimeGraph(**{setting: -1.0})


@pytest.fixture(scope="module")
def halves(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("anime_soft") / "corpus", utterances=28).split(0)


@pytest.fixture(scope="module", autouse=True)
def quick():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(prediction, "STEPS", 12)
        yield


@pytest.fixture(scope="module")
def soft(halves):
    return AnimeGraph(**SOFT, **FAST).fit(halves[0], seed=1)


def changed(model, tmp_path, **settings):
    """The same model under other settings, through a file."""
    model.save(tmp_path / "model.safetensors")
    other = load(tmp_path / "model.safetensors")
    other.config |= settings
    return other


def test_the_pose_cost_is_the_mean_squared_distance_of_stretched_motion(soft, halves):
    wishes, metric = soft.wishes(next(iter(halves[1])).speech), soft.components.metric.numpy()
    for wish in wishes:
        candidates = soft.chooser.candidates(wish.phone, wish.emotion)
        assert len(wish.expected) == wish.frames
        motions = [
            time_warp(soft.chooser.motion(int(n), int(k)), wish.frames)
            for n, k in zip(candidates.nodes, candidates.maps, strict=True)
        ]
        np.testing.assert_allclose(stretched_motions(soft.chooser, candidates, wish.frames), motions, atol=1e-9)
        wanted = [((motion @ metric - wish.expected) ** 2).sum(axis=1).mean() for motion in motions]
        np.testing.assert_allclose(pose_costs(soft.chooser, candidates, wish.expected, metric), wanted)


def test_a_metric_distance_is_that_of_frames(soft, halves):
    frames = soft.components.decode_array(soft.components.encode_array(next(iter(halves[0])).motion.frames))
    coordinates = soft.in_metric(torch.from_numpy(frames)).numpy()
    np.testing.assert_allclose(((coordinates[0] - coordinates[5]) ** 2).sum(), ((frames[0] - frames[5]) ** 2).mean(), rtol=1e-6)


def test_the_pose_term_draws_the_path_to_what_is_expected(soft, halves, tmp_path):
    speech = next(iter(halves[1])).speech

    def distance(weight):
        plan = changed(soft, tmp_path, temperature=0.0, pose_weight=weight).plan(speech)
        return sum(step.pose[chosen] for step, chosen in zip(plan.steps, plan.path, strict=True))

    assert distance(1e4) < distance(1e-9)


def test_cold_the_mean_is_the_chosen_nodes(soft, halves):
    speech = next(iter(halves[1])).speech
    plan = soft.plan(speech)
    pieces = [
        make_piece(soft.chooser, w, c, int(i)).motion for w, c, i in zip(plan.wishes, plan.candidates, plan.path, strict=True)
    ]
    np.testing.assert_allclose(
        mean_motion(soft.chooser, plan, soft_path(plan.steps, soft.weights, 1e-7)), np.concatenate(pieces), atol=1e-6
    )


def test_sharpening_adds_motion_and_a_saved_model_speaks_alike(soft, halves, tmp_path):
    utterance = next(iter(halves[1]))
    made = [changed(soft, tmp_path, sharpening=share).synthesize(utterance.speech) for share in (0.0, 0.5, 1.0)]
    energies = [energy_ratio(motion, utterance.motion) for motion in made]
    assert energies[0] < energies[1] < energies[2]
    assert made[0].frames.tobytes() == soft.synthesize(utterance.speech).frames.tobytes()


def test_the_gradient_of_the_error_is_that_of_small_steps(soft, halves):
    lattices = [lattice_of(soft, next(iter(halves[1])))]
    logs = Logs({name: soft.config[name] for name in NUMBERS}, {})
    lattices[0].truth[3:6] = torch.nan  # a gap
    mean_error(lattices, logs, 2.0).backward()
    for place in range(len(NUMBERS)):
        slopes = []
        for step in (1e-4, -1e-4):
            with torch.no_grad():
                logs.numbers[place] += step
                slopes.append(float(mean_error(lattices, logs, 2.0)))
                logs.numbers[place] -= step
        assert float(logs.numbers.grad[place]) == pytest.approx((slopes[0] - slopes[1]) / 2e-4, rel=1e-3, abs=1e-9)


def test_learning_does_not_make_the_held_out_error_larger_repeats_and_is_kept(halves):
    settings = {**SOFT, **FAST, "sharpening": 0.5}
    found = learn(halves[0], settings, seed=2, rounds=20)
    assert 0 <= found.improvement < 1
    assert set(found.settings) == {*NUMBERS, "sharpening"}
    model = train(AnimeGraph, halves[0], {**settings, "learn": True}, seed=2)
    assert {name: model.config[name] for name in found.settings} == found.settings
    assert model.facts["learned"]["improvement"] == found.improvement


def test_learning_needs_a_temperature(halves):
    with pytest.raises(FacesynthError, match="temperature"):
        learn(halves[0], {})


def test_the_shipped_soft_settings(repository):
    config = AnimeGraph.from_config(load_config(repository / "configs" / "anime_graph_soft.yaml")).config
    assert min(config["temperature"], config["pose_weight"], config["sharpening"]) > 0
    assert config["learn"]
    still = AnimeGraph.from_config(load_config(repository / "configs" / "anime_graph_soft_still.yaml")).config
    assert still == {**config, "sharpening": 0.0}
