"""The soft search of the anime graph against all paths."""

import itertools

import numpy as np
import pytest
from test_anime_search import random_steps

from facesynth.errors import FacesynthError
from facesynth.methods.anime_graph.search import Weights, best_path, path_cost
from facesynth.methods.anime_graph.soft import soft_path

WEIGHTS = Weights(20.0, 1.0, 0.05)


@pytest.mark.parametrize("temperature", [0.5, 10.0, 500.0])
@pytest.mark.parametrize("seed", range(6))
def test_equals_the_enumeration_of_all_paths(seed, temperature):
    steps = random_steps(seed, 5)
    paths = np.array(list(itertools.product(*(range(len(s.audio)) for s in steps))))
    costs = np.array([path_cost(steps, path, WEIGHTS) for path in paths])
    shares = np.exp(-(costs - costs.min()) / temperature)
    shares /= shares.sum()
    for t, found in enumerate(soft_path(steps, WEIGHTS, temperature)):
        np.testing.assert_allclose(found, np.bincount(paths[:, t], shares, len(found)), atol=1e-9)


@pytest.mark.parametrize("seed", range(6))
def test_cold_it_is_the_cheapest_path(seed):
    steps = random_steps(seed, 8, most=6)
    found = soft_path(steps, WEIGHTS, 1e-6)
    np.testing.assert_array_equal([shares.argmax() for shares in found], best_path(steps, WEIGHTS)[0])


def test_no_temperature():
    with pytest.raises(FacesynthError, match="above 0"):
        soft_path(random_steps(0, 3), WEIGHTS, 0.0)
