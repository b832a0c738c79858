import numpy as np
import pytest
import torch

from facesynth.inference.errors import FacesynthError
from facesynth.motion.rbf import RbfMap, apart, closest_distance, cluster_means, median_distance


@pytest.fixture
def samples():
    rng = np.random.default_rng(0)
    points = rng.normal(size=(80, 3))
    return points, np.stack([np.sin(points[:, 0]), points[:, 1] * points[:, 2]], axis=1)


@pytest.mark.parametrize("kernel", ["exponential", "gaussian"])
def test_passes_through_its_samples(samples, kernel):
    points, values = samples
    rbf = RbfMap.fit(points, values, width=1.0, kernel=kernel)
    np.testing.assert_allclose(rbf(torch.from_numpy(points)), values, atol=0.01)


def test_is_smooth_between_and_fades_far_away(samples):
    points, values = samples
    rbf = RbfMap.fit(points, values, width=1.0, kernel="gaussian")
    new = np.random.default_rng(1).normal(size=(200, 3)) * 0.6
    error = rbf(torch.from_numpy(new)).numpy()[:, 0] - np.sin(new[:, 0])
    assert np.sqrt(np.mean(error**2)) < 0.25
    assert rbf(torch.full((1, 3), 100.0)).abs().max() == 0


def test_one_centre_is_a_bump():
    rbf = RbfMap.fit(np.zeros((1, 2)), np.ones((1, 1)), width=2.0, kernel="exponential")
    np.testing.assert_allclose(rbf(torch.tensor([[0.0, 2.0], [4.0, 0.0]])), [[np.exp(-1)], [np.exp(-2)]], rtol=1e-5)


def test_equal_centres_are_merged():
    centres, values = apart(np.array([[0.0], [1.0], [1e-8], [0.0]]), np.array([[1.0], [5.0], [2.0], [3.0]]))
    np.testing.assert_array_equal(centres, [[0.0], [1.0]])
    np.testing.assert_allclose(values, [[2.0], [5.0]])


def test_clusters_carry_their_members_mean():
    points = np.concatenate([np.zeros((10, 2)), np.ones((30, 2))]) + np.random.default_rng(0).normal(size=(40, 2)) * 1e-3
    values = np.repeat([[1.0], [4.0]], [10, 30], axis=0)
    centres, means = cluster_means(points, values, 2)
    order = np.argsort(means[:, 0])
    np.testing.assert_allclose(means[order, 0], [1, 4])
    np.testing.assert_allclose(centres[order], [[0, 0], [1, 1]], atol=0.01)
    assert cluster_means(points, values, 100)[0] is points


def test_distances_between_points():
    points = np.array([[0.0], [0.0], [3.0], [10.0]])
    assert closest_distance(points) == 3.0
    assert median_distance(points) == 5.0
    assert median_distance(points[:1]) == closest_distance(points[:1]) == 1.0


def test_nonsense_is_refused():
    with pytest.raises(FacesynthError, match="kernel"):
        RbfMap.fit(np.zeros((1, 1)), np.zeros((1, 1)), width=1, kernel="thin plate")
    with pytest.raises(FacesynthError, match="width"):
        RbfMap.fit(np.zeros((1, 1)), np.zeros((1, 1)), width=0, kernel="gaussian")
