"""Rotations: unit length, shortest arcs, and curves that pass through their key points without corners."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from facesynth.inference import quaternions as q


def random_rotations(count, largest_rad=3.0, seed=0):
    rng = np.random.default_rng(seed)
    axis = rng.standard_normal((count, 3))
    return axis / np.linalg.norm(axis, axis=1, keepdims=True) * rng.uniform(0, largest_rad, (count, 1))


def scipy_of(quaternions):
    return Rotation.from_quat(quaternions[..., [1, 2, 3, 0]])


def test_rotation_vectors_come_back():
    rotvec = np.concatenate([random_rotations(50), 1e-9 * random_rotations(5), np.zeros((1, 3))])
    assert np.allclose(q.to_rotvec(q.from_rotvec(rotvec)), rotvec, atol=1e-12)
    assert np.allclose(scipy_of(q.from_rotvec(rotvec)).as_rotvec(), rotvec, atol=1e-9)


def test_the_product_is_one_rotation_after_the_other():
    a, b = q.from_rotvec(random_rotations(20)), q.from_rotvec(random_rotations(20, seed=1))
    assert np.allclose(scipy_of(q.multiply(a, b)).as_matrix(), (scipy_of(a) * scipy_of(b)).as_matrix())
    assert np.allclose(q.multiply(a, q.inverse(a)), [1, 0, 0, 0])


@pytest.mark.parametrize("flip", [1, -1])
def test_slerp_takes_the_shortest_arc_at_constant_speed(flip):
    a, b = q.from_rotvec(random_rotations(2, 1.2))
    share = np.linspace(0, 1, 11)
    path = q.slerp(np.tile(a, (11, 1)), np.tile(flip * b, (11, 1)), share)
    assert np.allclose(scipy_of(path).as_matrix(), Slerp([0, 1], scipy_of(np.stack([a, b])))(share).as_matrix(), atol=1e-9)


def test_squad_passes_its_key_points_with_unit_length_and_without_corners():
    rng = np.random.default_rng(0)
    keys = q.from_rotvec(np.cumsum(0.2 * rng.standard_normal((8, 3)), axis=0)) * np.where(rng.random(8) < 0.5, 1, -1)[:, None]
    at = np.linspace(0, 7, 701)
    path = q.squad(keys, at)
    assert np.allclose(np.linalg.norm(path, axis=1), 1)
    assert np.allclose(scipy_of(path[::100]).as_matrix(), scipy_of(keys).as_matrix(), atol=1e-9)
    speed = q.to_rotvec(q.multiply(q.inverse(path[:-1]), path[1:])) / 0.01
    jumps = np.linalg.norm(np.diff(speed, axis=0), axis=1)
    assert jumps[99::100].max() < 5 * np.median(jumps) + 0.05


def test_one_key_point_is_held():
    key = q.from_rotvec(np.array([[0.1, 0.2, 0.3]]))
    assert np.allclose(q.squad(key, np.zeros(4)), key)
