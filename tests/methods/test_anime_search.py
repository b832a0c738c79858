import itertools

import numpy as np
import pytest

from facesynth.inference.anime_graph.search import (
    NUMPY,
    LookAhead,
    Step,
    Weights,
    best_path,
    jumps,
    look_ahead_path,
    path_cost,
)
from facesynth.inference.errors import FacesynthError
from facesynth.methods.anime_graph.torch_search import torch_search

PAPER = Weights()
ENGINES = {"numpy": NUMPY, "torch": torch_search()}


def random_steps(seed, length, *, most=4, dimension=3, chained=0.4):
    """Steps of random candidates; a share of them has a captured predecessor among those before."""
    rng = np.random.default_rng(seed)
    counts = rng.integers(1, most + 1, length)
    steps = []
    for t, n in enumerate(counts):
        link = np.full(n, -1)
        if t:
            linked = rng.permutation(min(n, counts[t - 1]))[: rng.binomial(min(n, counts[t - 1]), chained)]
            link[linked] = rng.permutation(counts[t - 1])[: len(linked)]
        steps.append(Step(rng.uniform(0, 900, n), rng.normal(size=(n, dimension)), rng.normal(size=(n, dimension)), link))
    return steps


def exhaustive(steps, weights):
    """Every path there is, at the price that eq. 2 gives it, written out."""
    best = np.inf
    for path in itertools.product(*(range(len(s.audio)) for s in steps)):
        cost = 0.0
        for t, c in enumerate(path):
            cost += weights.audio * steps[t].audio[c]
            if t and steps[t].link[c] != path[t - 1]:
                gap = steps[t - 1].last[path[t - 1]] - steps[t].first[c]
                cost += weights.jump + weights.jump_cost * np.sqrt((gap**2).sum())
        best = min(best, cost)
    return best


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("weights", [PAPER, Weights(2.0, 1.0, 0.01), Weights(0.0, 1.0, 0.0)])
@pytest.mark.parametrize("seed", range(25))
def test_equals_exhaustive_enumeration(seed, weights, engine):
    steps = random_steps(seed, 1 + seed % 6)
    path, cost = ENGINES[engine].best_path(steps, weights)
    assert cost == pytest.approx(exhaustive(steps, weights), rel=1e-12)
    assert path_cost(steps, path, weights) == pytest.approx(cost, rel=1e-12)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("seed", range(5))
def test_the_mean_over_paths_is_that_of_all_paths(seed, engine):
    steps, weights, temperature = random_steps(seed, 5), Weights(2.0, 1.0, 0.01), 1.5
    sums = [np.zeros(len(step.audio)) for step in steps]
    for path in itertools.product(*(range(len(step.audio)) for step in steps)):
        share = np.exp(-path_cost(steps, path, weights) / temperature)
        for total, candidate in zip(sums, path, strict=True):
            total[candidate] += share
    for shares, total in zip(ENGINES[engine].soft_path(steps, weights, temperature), sums, strict=True):
        np.testing.assert_allclose(shares, total / total.sum(), rtol=1e-9)


@pytest.mark.parametrize("seed", range(20))
def test_look_ahead_is_never_better_and_full_look_ahead_is_optimal(seed):
    steps = random_steps(seed, 12, most=8)
    best = best_path(steps, PAPER)[1]
    costs = [path_cost(steps, look_ahead_path(steps, PAPER, phones), PAPER) for phones in (1, 3, 6, 12)]
    assert min(costs) >= best * (1 - 1e-12)
    assert costs[-1] == pytest.approx(best)


def test_short_sight_costs_something_somewhere():
    extra = [
        path_cost(s, look_ahead_path(s, PAPER, 1), PAPER) - best_path(s, PAPER)[1]
        for s in (random_steps(seed, 12, most=8) for seed in range(20))
    ]
    assert max(extra) > 50


def test_look_ahead_settles_a_phone_as_soon_as_it_sees_enough():
    steps = random_steps(3, 10)
    search = LookAhead(PAPER, 3)
    settled = [len(search.push(step)) for step in steps]
    assert settled == [0, 0, 0, 1, 1, 1, 1, 1, 1, 1]
    assert len(search.finish()) == 3


def test_a_captured_chain_wins_over_better_sound():
    steps = [Step(np.array([0.0, 500.0]), np.zeros((2, 1)), np.zeros((2, 1)), np.array([-1, 1 if t else -1])) for t in range(4)]
    path, cost = best_path(steps, PAPER)
    np.testing.assert_array_equal(path, [1, 1, 1, 1])
    assert cost == pytest.approx(20)
    assert not jumps(steps, path).any()


def test_among_equal_jumps_the_nearest_motion_wins():
    last = np.array([[0.0]])
    steps = [
        Step(np.zeros(1), last, last, np.array([-1])),
        Step(np.zeros(3), np.array([[5.0], [1.0], [3.0]]), np.zeros((3, 1)), np.full(3, -1)),
    ]
    path, cost = best_path(steps, PAPER)
    assert path.tolist() == [0, 1]
    assert cost == pytest.approx(101)


def test_no_look_ahead_is_an_error():
    with pytest.raises(FacesynthError, match="3 to 6"):
        LookAhead(PAPER, 0)
