"""A search that weighs what it expects by certainty: what is known of it without any recording."""

from importlib import import_module

import numpy as np
import pytest

from facesynth.inference.efase.hearing import PoseDistances
from facesynth.inference.efase.nodes import Nodes

DIMENSIONS, FRAMES = 4, 5


@pytest.fixture
def certainty(monkeypatch, repository):
    monkeypatch.syspath_prepend(repository / "benchmarks")
    return import_module("search_certainty")


@pytest.fixture
def nodes():
    rng = np.random.default_rng(1)
    pieces = [rng.normal(size=(length, DIMENSIONS)) for length in (3, 5, 1, 8)]
    four = np.zeros(4, np.int64)
    return Nodes.from_pieces(pieces, four, four, four, four - 1)


def distances(module, nodes, variances, **certainty):
    """By components that are twice the coordinates, in another order, with known variances [F, R]."""
    into = 2 * np.eye(DIMENSIONS)[[2, 0, 3, 1]]  # [R, D]
    spread = (nodes.frames @ np.linalg.inv(into)).var(axis=0)
    usual, size = variances.mean(axis=0), np.square(into).sum(axis=1)
    made = module.CertainDistances(nodes, np.linalg.inv(into), spread, size, usual, module.Certainty(**certainty))
    return made.scaled(variances)


def asked(variances):
    """A piece of expected poses and what is said of their variances."""
    poses = np.random.default_rng(2).normal(size=(FRAMES, DIMENSIONS))
    return poses, np.hstack([poses, np.log(variances)])


@pytest.mark.parametrize("kind", [{}, {"power": 0.5}, {"components": False}, {"moments": False}])
def test_equal_certainty_is_the_cost_without_it(certainty, nodes, kind):
    variances = np.full((FRAMES, DIMENSIONS), 0.3)
    poses, piece = asked(variances)
    found = distances(certainty, nodes, variances, **kind).of([piece])
    np.testing.assert_allclose(found, PoseDistances(nodes, np.ones(DIMENSIONS)).of([poses]), rtol=1e-6)


def test_a_component_of_which_nothing_is_known_counts_nothing(certainty, nodes):
    variances = np.tile([0.3, 1e12, 0.3, 0.3], (FRAMES, 1))
    _, piece = asked(variances)
    made = distances(certainty, nodes, variances)
    moved = piece.copy()
    moved[:, 0] += 5.0  # the coordinate of the second component
    np.testing.assert_allclose(made.of([moved]), made.of([piece]), rtol=1e-6)
    moved[:, 1] += 5.0
    assert not np.allclose(made.of([moved]), made.of([piece]), rtol=0.1)


def test_a_moment_of_which_nothing_is_known_counts_nothing(certainty, nodes):
    variances = np.full((FRAMES, DIMENSIONS), 0.3)
    variances[2] = 1e12
    _, piece = asked(variances)
    made = distances(certainty, nodes, variances, components=False)
    moved = piece.copy()
    moved[2, :DIMENSIONS] += 5.0
    np.testing.assert_allclose(made.of([moved]), made.of([piece]), rtol=1e-6)


def test_as_unsure_as_all_poses_are_spread_counts_nothing(certainty, nodes):
    into = 2 * np.eye(DIMENSIONS)[[2, 0, 3, 1]]
    spread = (nodes.frames @ np.linalg.inv(into)).var(axis=0)
    variances = np.tile(spread, (FRAMES, 1))
    variances[:, 3] /= 4
    _, piece = asked(variances)
    made = distances(certainty, nodes, variances, beyond_spread=True)
    moved = piece.copy()
    moved[:, [2, 0, 3]] -= 5.0  # of the first three components
    np.testing.assert_allclose(made.of([moved]), made.of([piece]), rtol=1e-6)
