"""The soft search against all paths, one by one."""

from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
import torch
from corpora import tiny_corpus
from literal_search import joint_cost, literal, path_cost, shape_cost, transition_cost
from test_efase_search import random_nodes, random_query, search

from facesynth.inference.efase.assembly import Smoothing, concatenate
from facesynth.inference.efase.costs import Query, Weights, all_targets
from facesynth.inference.efase.soft import Mixture, candidates, soft_search
from facesynth.inference.efase.steps import step_terms
from facesynth.inference.errors import FacesynthError
from facesynth.inference.warp import stretched, time_warp
from facesynth.methods.efase.learning import tensors
from facesynth.methods.efase.method import Efase
from facesynth.methods.efase.torch_search import torch_mix
from facesynth.methods.registry import load
from facesynth.motion.search.posterior import posterior
from facesynth.motion.search.steps import GivenSteps


def enumerated(nodes, query, extra, weights, temperature, allowed):
    """Posteriors [T, N] and probabilities of captured steps by adding up exp(-(COST + extra) / temperature) over all paths."""
    paths = np.array(list(product(*allowed)))
    costs = np.array([path_cost(nodes, query, p, weights) + extra[np.arange(len(p)), p].sum() for p in paths])
    shares = np.exp(-(costs - costs.min()) / temperature)
    shares /= shares.sum()
    singles = np.zeros(extra.shape)
    for t in range(len(query)):
        np.add.at(singles[t], paths[:, t], shares)
    captured = [(shares * (nodes.before[paths[:, t]] == paths[:, t - 1])).sum() for t in range(1, len(query))]
    return singles, np.array([0.0, *captured])


def mixed(found, count):
    singles = np.zeros((len(found), count))
    for row, mixture in zip(singles, found, strict=True):
        row[mixture.nodes] = mixture.shares
    return singles


@pytest.mark.parametrize("mixing", [None, torch_mix])
@pytest.mark.parametrize("temperature", [0.3, 5.0, 200.0])
@pytest.mark.parametrize("fixed", [0, 1])
def test_equals_the_enumeration_of_all_paths(temperature, fixed, mixing):
    rng = np.random.default_rng(int(temperature * 10) + fixed)
    for _ in range(6):
        nodes, weights = random_nodes(rng, 7, sentence=4), Weights(3.0)
        nodes.visemes[0] = 0  # a class that may be demanded has a node
        query = random_query(rng, nodes, 4, fixed=fixed)
        extra = rng.uniform(0, 3, (4, 7))
        targets = all_targets(nodes, query, weights) + extra
        path = targets.argmin(axis=1)
        allowed = [np.flatnonzero(np.isfinite(row)) for row in targets]
        mix = mixing and mixing(nodes, weights)
        found = soft_search(nodes, query, targets, weights, path, temperature, 7, mix=mix)
        singles, captured = enumerated(nodes, query, extra, weights, temperature, allowed)
        np.testing.assert_allclose(mixed(found, 7), singles, atol=1e-9)
        np.testing.assert_allclose([m.captured for m in found], captured, atol=1e-9)


def test_a_limited_set_of_candidates_is_exact_over_the_paths_through_it():
    rng = np.random.default_rng(0)
    nodes, weights = random_nodes(rng, 30), Weights(3.0)
    query = random_query(rng, nodes, 4)
    targets = all_targets(nodes, query, weights)
    path = literal(nodes, query, weights)[1]
    allowed = candidates(nodes, query, targets, weights, path, 5)
    assert all(node in row and len(row) <= 6 for node, row in zip(path, allowed, strict=True))
    found = soft_search(nodes, query, targets, weights, path, 2.0, 5)
    singles, captured = enumerated(nodes, query, np.zeros((4, 30)), weights, 2.0, allowed)
    np.testing.assert_allclose(mixed(found, 30), singles, atol=1e-9)
    np.testing.assert_allclose([m.captured for m in found], captured, atol=1e-9)


def test_cold_it_is_the_cheapest_path():
    rng = np.random.default_rng(1)
    for _ in range(10):
        nodes, weights = random_nodes(rng), Weights(10.0)
        query = random_query(rng, nodes, 8, fixed=1)
        _, path = literal(nodes, query, weights)
        targets = all_targets(nodes, query, weights) + rng.uniform(0, 1e-3, (8, len(nodes)))  # no ties
        targets[np.arange(8), path] -= 1e-2
        for limit in (1, 10, 40):
            found = soft_search(nodes, query, targets, weights, path, 1e-6, limit)
            assert [m.nodes[m.shares.argmax()] for m in found] == list(path)
            assert min(m.shares.max() for m in found) > 1 - 1e-9


def test_cold_it_finds_the_path_of_the_exact_search_without_being_told():
    rng = np.random.default_rng(12)
    for pnt in (0.3, 3.0, 100.0):
        for _ in range(5):
            nodes, weights = random_nodes(rng), Weights(pnt)
            query = replace(random_query(rng, nodes, 7), heard=rng.exponential(pnt, (7, len(nodes))))  # no ties
            _, exact = search(nodes, query, weights)
            targets = all_targets(nodes, query, weights)
            found = soft_search(nodes, query, targets, weights, targets.argmin(axis=1), 1e-7, len(nodes))
            assert [m.nodes[m.shares.argmax()] for m in found] == list(exact)
            assert min(m.shares.max() for m in found) > 1 - 1e-9


def test_its_free_energy_is_the_sum_over_all_paths_and_falls_to_the_least_cost():
    rng = np.random.default_rng(13)
    for _ in range(5):
        nodes, weights = random_nodes(rng, 6, sentence=3), Weights(3.0)
        query = replace(random_query(rng, nodes, 4), heard=rng.exponential(3.0, (4, 6)))
        targets = [torch.from_numpy(row)[None] for row in all_targets(nodes, query, weights)]
        terms = tensors(step_terms(nodes, np.arange(6), np.arange(6)))
        steps = GivenSteps([terms.cost(weights.pnt, weights.alpha, weights.beta, weights.eta).mT] * 3)
        every = np.array([path_cost(nodes, query, np.array(path), weights) for path in product(range(6), repeat=4)])
        energies = []
        for temperature in (0.01, 0.5, 5.0):
            energies.append(-temperature * float(posterior(targets, steps, temperature).log_z))
            assert energies[-1] == pytest.approx(-temperature * np.logaddexp.reduce(-every / temperature), abs=1e-9)
        assert energies[0] > energies[1] > energies[2]
        assert energies[0] == pytest.approx(every.min(), abs=0.01 * np.log(len(every)))


def test_hot_every_candidate_is_alike():
    rng = np.random.default_rng(2)
    nodes, weights = random_nodes(rng, 20), Weights(1.0)
    query = Query(np.array([0, 1]), np.array([0, 0]), np.array([-1, -1]), {})
    targets = all_targets(nodes, query, weights)
    for mixture in soft_search(nodes, query, targets, weights, np.array([0, 0]), 1e9, 20):
        np.testing.assert_allclose(mixture.shares, 1 / 20, rtol=1e-4)


def test_the_candidates_look_cheapest():
    rng = np.random.default_rng(3)
    nodes, weights = random_nodes(rng, 40), Weights(10.0)
    query = Query(np.array([2, 3]), np.array([1, 1]), np.array([0, 0]), {})
    targets = all_targets(nodes, query, weights)
    path = literal(nodes, query, weights)[1]
    for limit in (1, 4, 12):
        chosen = candidates(nodes, query, targets, weights, path, limit)
        assert all(len(row) <= limit + 1 and (np.diff(row) > 0).all() for row in chosen)
    right = [j for j in chosen[1] if nodes.before[j] >= 0 and nodes.visemes[nodes.before[j]] == 1]
    everywhere = np.flatnonzero((nodes.before >= 0) & (nodes.visemes[nodes.before] == 1) & (targets[1] == 0))
    assert set(everywhere) <= set(right)


@pytest.mark.parametrize("shortest", [1, 3])
def test_the_terms_add_up_to_the_transition_cost(shortest):
    rng = np.random.default_rng(4)
    nodes = random_nodes(rng, 25, shortest=shortest)
    weights = Weights(2.0)
    before, after = rng.choice(25, 9, replace=False), rng.choice(25, 12, replace=False)
    terms = step_terms(nodes, before, after)
    costs = terms.cost(weights.pnt, weights.alpha, weights.beta, weights.eta)
    wanted = [[transition_cost(nodes, int(i), int(j), weights) for j in after] for i in before]
    np.testing.assert_allclose(costs, wanted, rtol=1e-9, atol=1e-9)
    for a, i in enumerate(before):
        for b, j in enumerate(after):
            if terms.captured[a, b] or terms.orphans[b]:
                assert terms.bend[a, b] == terms.place[a, b] == terms.speed[a, b] == terms.switches[a, b] == 0
            else:
                np.testing.assert_allclose(terms.bend[a, b], shape_cost(nodes, i, nodes.before[j]), rtol=1e-9, atol=1e-9)
                joint = weights.eta * terms.place[a, b] + terms.speed[a, b]
                np.testing.assert_allclose(joint, joint_cost(nodes, i, j, weights), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("count", [1, 2, 5, 9])
def test_many_nodes_are_stretched_like_one(count):
    nodes = random_nodes(np.random.default_rng(5), 12)
    together = stretched(nodes, np.arange(12), count)
    for node in range(12):
        np.testing.assert_allclose(together[node], time_warp(nodes.motion(node), count), atol=1e-12)


def test_gradients_are_those_of_the_costs():
    rng = np.random.default_rng(6)
    targets = [torch.from_numpy(rng.normal(size=(1, n))).requires_grad_() for n in (3, 4, 2)]
    steps = [torch.from_numpy(rng.normal(size=(1, j, i))).requires_grad_() for i, j in pairwise((3, 4, 2))]

    def singles(*costs):
        return tuple(posterior(costs[:3], GivenSteps(costs[3:]), 0.7).nodes)

    assert torch.autograd.gradcheck(singles, (*targets, *steps))
    found = posterior(targets, GivenSteps(steps), 0.7)
    by_gradient = torch.autograd.grad(-0.7 * found.log_z.sum(), [*targets, *steps])
    pairs = [found.of_steps(t).mT for t in range(2)]
    for probability, gradient in zip([*found.nodes, *pairs], by_gradient, strict=True):
        torch.testing.assert_close(probability, gradient)


@pytest.mark.parametrize("fixed", [0, 2])
def test_the_exact_search_with_an_audio_cost_equals_the_literal_algorithm(fixed):
    rng = np.random.default_rng(7 + fixed)
    for pnt in (0.1, 3.0, 100.0):
        for _ in range(6):
            nodes, weights = random_nodes(rng), Weights(pnt)
            query = random_query(rng, nodes, 7, fixed=fixed)
            query = replace(query, heard=rng.exponential(pnt, (7, len(nodes))))
            cost, path = literal(nodes, query, weights)
            found, nodes_found = search(nodes, query, weights)
            np.testing.assert_allclose(found, cost, rtol=1e-9)
            np.testing.assert_array_equal(nodes_found, path)


def test_certain_mixtures_concatenate_like_their_path():
    rng = np.random.default_rng(8)
    nodes = random_nodes(rng, 30, shortest=2)
    path = np.array([3, 4, 20, 21, 9])
    phones, bounds = ("b", "aa", "t", "pau", "iy"), np.array([0, 5, 12, 16, 19, 26])
    rest = np.zeros((5, 3))
    captured = [0.0, *(float(nodes.before[j] == i) for i, j in pairwise(path))]
    mixtures = [Mixture(np.array([node]), np.ones(1), c) for node, c in zip(path, captured, strict=True)]
    alone = concatenate(nodes, path, phones, bounds, rest, 120, Smoothing())
    np.testing.assert_allclose(concatenate(nodes, path, phones, bounds, rest, 120, Smoothing(), mixtures), alone, atol=1e-12)
    unsmoothed = concatenate(nodes, path, phones, bounds, rest, 120, Smoothing(stiffness=0))
    np.testing.assert_allclose(unsmoothed[5:12], time_warp(nodes.motion(4), 7))
    np.testing.assert_allclose(unsmoothed[12:16], time_warp(nodes.motion(20), 4))


@pytest.fixture(scope="module")
def halves(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("soft") / "corpus", utterances=20, fps=60).split(0)


@pytest.fixture(scope="module")
def cold(halves):
    return Efase().fit(halves[0])


def test_a_method_goes_from_the_cheapest_path_to_the_mean(cold, halves):
    speech = next(iter(halves[1])).speech
    base = cold.synthesize(speech).frames
    distances, energies = [], []
    for temperature in (1e-7, 1.0, 100.0):
        made = cold.with_weights(temperature=temperature).synthesize(speech).frames
        assert made.shape == base.shape
        distances.append(np.abs(made - base).mean())
        energies.append(np.abs(np.diff(made, axis=0)).mean())
    assert distances[0] < 0.1 * distances[1] < 0.1 * distances[2]
    assert energies[0] > energies[1] > energies[2]


def test_soft_models_repeat_and_survive_saving(cold, halves, tmp_path):
    speech = next(iter(halves[1])).speech
    model = cold.with_weights(temperature=0.5, candidates=20)
    model.save(tmp_path / "soft.safetensors")
    assert load(tmp_path / "soft.safetensors").synthesize(speech).frames.tobytes() == model.synthesize(speech).frames.tobytes()


def test_hard_constraints_stay_hard(cold, halves):
    speech = max((u.speech for u in halves[1]), key=lambda s: len(s.phones))
    place = next(i for i, p in enumerate(speech.phones.labels) if p != "pau")
    plan = cold.with_weights(temperature=50.0).plan(speech, constraints={place: cold.facts["names"][7]})
    np.testing.assert_array_equal(plan.mixtures[place].nodes, [7])


@pytest.mark.parametrize("settings", [{"temperature": -1}, {"candidates": 0}, {"sharpening": -0.1}, {"pose_weight": -1}])
def test_settings_without_meaning(settings):
    with pytest.raises(FacesynthError, match="at least"):
        Efase(**settings)
