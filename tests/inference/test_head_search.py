"""The search over recorded head movements: exact neighbours, and paths as cheap as all paths tried one by one."""

from itertools import product

import numpy as np
import pytest
from scipy.spatial import KDTree

from facesynth.inference.errors import FacesynthError
from facesynth.inference.head.neighbours import Neighbours
from facesynth.inference.head.search import Candidates, Scales, best_paths, poses_along

SCALES = Scales(np.array([0.01, 0.02, 0.01, 0.5, 0.4, 0.6]), np.array([0.1, 0.1, 0.2, 3.0, 2.0, 4.0]))
START = np.array([0.05, 0, 0, 1.0, 0, 0])


def problem(rng, frames=5, count=3, keyed=(2,)):
    targets = np.repeat(rng.normal(size=(1, 6)) * SCALES.pose, frames, axis=0)
    for frame in keyed:
        targets[: frame + 1] = rng.normal(size=6) * SCALES.pose
    moves = rng.normal(size=(frames, count, 6)) * SCALES.move * 8
    return Candidates(rng.random((frames, count)), moves, targets, np.isin(np.arange(frames), keyed))


def cost_of(found, path, weights):
    """The sum of eq. 4.6 with AE at key poses and at the end alone, as plain as it can be written."""
    near, rough, away = weights
    cost, pose, before = 0.0, START, None
    for t, j in enumerate(path):
        move = found.moves[t, j]
        pose = pose + move
        cost += near * found.distances[t, j]
        if before is not None:
            cost += rough * np.linalg.norm((move - before) / SCALES.move)
        if found.keyed[t] or t == len(path) - 1:
            cost += away * np.linalg.norm((found.targets[t] - pose) / SCALES.pose)
        before = move
    return cost


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize(("weights", "beam"), [((0.4, 0.6, 0.0), 1), ((0.3, 0.3, 0.4), 81), ((0.1, 0.1, 0.8), 81)])
def test_the_best_path_is_that_of_all_paths(seed, weights, beam):
    found = problem(np.random.default_rng(seed))
    costs, chosen = best_paths(found, np.array([weights]), START, SCALES, beam)
    every = {path: cost_of(found, path, weights) for path in product(range(3), repeat=5)}
    assert costs[0] == pytest.approx(min(every.values()), rel=1e-12)
    assert every[tuple(int(j) for j in chosen[0])] == pytest.approx(costs[0], rel=1e-12)


def test_one_path_kept_states_its_true_cost_and_is_seldom_far_from_the_best():
    excess = []
    for seed in range(20):
        found = problem(np.random.default_rng(seed))
        costs, chosen = best_paths(found, np.array([[0.3, 0.3, 0.4]]), START, SCALES, 1)
        assert costs[0] == pytest.approx(cost_of(found, chosen[0], (0.3, 0.3, 0.4)), rel=1e-12)
        excess.append(costs[0] / best_paths(found, np.array([[0.3, 0.3, 0.4]]), START, SCALES, 81)[0][0])
    assert min(excess) >= 1 - 1e-12
    assert np.mean(excess) < 1.15


def test_weights_are_searched_together_as_one_by_one():
    found = problem(np.random.default_rng(3), frames=12, count=4)
    weights = np.random.default_rng(1).dirichlet(np.ones(3), 5)
    costs, chosen = best_paths(found, weights, START, SCALES, 2)
    for row, own in enumerate(weights):
        cost, path = best_paths(found, own[None], START, SCALES, 2)
        assert cost[0] == costs[row]
        np.testing.assert_array_equal(path[0], chosen[row])


def test_a_heavy_key_pose_is_reached_when_the_movements_allow_it():
    moves = np.zeros((40, 3, 6))
    moves[:, 1, 1], moves[:, 2, 1] = 0.01, -0.01
    targets = np.tile([0, 0.2, 0, 0, 0, 0], (40, 1))
    found = Candidates(np.zeros((40, 3)), moves, targets, np.arange(40) == 39)
    _, chosen = best_paths(found, np.array([[0.0, 0.0, 1.0]]), np.zeros(6), SCALES, 1)
    poses = poses_along(found, chosen[0], np.zeros(6))
    assert abs(poses[-1, 1] - 0.2) < 1e-9


@pytest.mark.parametrize(("points", "count"), [(5, 3), (64, 64), (65, 7), (3000, 7), (3000, 200)])
def test_neighbours_are_those_of_a_kd_tree(points, count):
    rng = np.random.default_rng(points)
    cloud, queries = rng.standard_normal((points, 4)) ** 3, rng.standard_normal((40, 4))
    distances, index = Neighbours(cloud).nearest(queries, count)
    wanted, wanted_index = KDTree(cloud).query(queries, k=count)
    np.testing.assert_allclose(distances, wanted.reshape(40, count), rtol=1e-9)
    np.testing.assert_array_equal(index, wanted_index.reshape(40, count))


def test_equal_neighbours_come_in_their_order():
    distances, index = Neighbours(np.zeros((200, 2))).nearest(np.ones((1, 2)), 3)
    np.testing.assert_array_equal(index, [[0, 1, 2]])
    np.testing.assert_allclose(distances, np.sqrt(2))


def test_more_neighbours_than_recorded_frames_are_refused():
    with pytest.raises(FacesynthError, match="7 neighbours of 5 recorded frames"):
        Neighbours(np.zeros((5, 4))).nearest(np.zeros((1, 4)), 7)
