"""What hidden Markov models of the head are learned with: codebooks, forward-backward, the network."""

from itertools import pairwise, product

import numpy as np
import pytest

from facesynth.inference.head.hmm import Network, curve_through, most_likely
from facesynth.inference.quaternions import from_angles, from_rotvec, to_angles
from facesynth.methods.head_hmm.baum_welch import Hmm, Mixtures, begun, learn, log_likelihood
from facesynth.methods.head_hmm.codebook import codebook
from facesynth.methods.head_hmm.method import composed, runs_of, without_short

RNG = np.random.default_rng(0)


@pytest.mark.parametrize("size", [1, 2, 3, 16, 32])
def test_the_distortion_of_a_codebook_never_rises(size):
    points = RNG.standard_normal((700, 3)) ** 3
    cells = codebook(points, size)
    assert len(cells.means) == size
    assert (np.diff(cells.distortions) <= 1e-12).all()
    squares = np.square(points[:, None] - cells.means).sum(axis=2)
    np.testing.assert_allclose(np.square(points - cells.means[cells.labels]).sum(axis=1), squares.min(axis=1), rtol=0.2)
    assert (np.bincount(cells.labels) > 0).all()


def test_a_codebook_finds_heaps_and_stops_where_all_points_are_alike():
    heaps = np.array([[0, 0], [10, 0], [0, 10], [10, 10.0]])
    cells = codebook(np.repeat(heaps, 50, axis=0) + 0.1 * np.random.default_rng(0).standard_normal((200, 2)), 4)
    assert {tuple(np.round(mean / 10) * 10) for mean in cells.means} == {tuple(heap) for heap in heaps}
    assert len(codebook(np.ones((20, 2)), 8).means) == 1


def test_a_codebook_ends_where_a_cell_has_nobody_on_the_side_to_which_it_is_split():
    assert len(codebook(np.array([[1.0, -1.0], [-1.0, 1.0]]), 2).means) == 1


def sequences(count=12, dimensions=2):
    """Of three states one after the other."""
    return [
        np.concatenate([RNG.normal(mean, 0.5, (RNG.integers(4, 12), dimensions)) for mean in (0.0, 2.0, -2.0)])
        for _ in range(count)
    ]


@pytest.mark.parametrize("all_follow", [False, True])
@pytest.mark.parametrize("mixtures", [1, 3])
def test_likelihood_never_falls_in_training(all_follow, mixtures):
    heard = sequences()
    _, course = learn(begun(heard, 3, mixtures, all_follow=all_follow), heard, 15)
    assert (np.diff(course) >= -1e-6 * np.abs(course[0])).all()
    assert course[-1] > course[0]


def test_forward_backward_sums_over_all_ways():
    start, step, out = np.array([0.7, 0.3]), np.array([[0.5, 0.3], [0.2, 0.5]]), np.array([0.2, 0.3])
    mixtures = Mixtures(np.zeros((2, 1)), np.array([[[0.0]], [[1.0]]]), np.ones((2, 1, 1)))
    model = Hmm(np.log(start), np.log(step), np.log(out), mixtures)
    frames = np.array([[0.2], [0.9], [1.4]])
    density = np.exp(-0.5 * (frames - [0.0, 1.0]) ** 2) / np.sqrt(2 * np.pi)
    total = 0.0
    for way in product(range(2), repeat=3):
        chance = start[way[0]] * out[way[-1]] * np.prod(density[range(3), way])
        total += chance * np.prod([step[a, b] for a, b in pairwise(way)])
    assert log_likelihood(model, [frames]) == pytest.approx(np.log(total))
    assert log_likelihood(model, [frames, frames[:2], frames]) == pytest.approx(
        2 * np.log(total) + log_likelihood(model, [frames[:2]])
    )


def test_states_of_a_known_talker_are_found_back():
    heard = sequences(60)
    model, _ = learn(begun(heard, 3, 1, all_follow=False), heard, 30)
    np.testing.assert_allclose(model.mixtures.means[:, 0], [[0, 0], [2, 2], [-2, -2]], atol=0.15)
    rows = np.exp(model.log_step).sum(axis=1) + np.exp(model.log_exit)
    np.testing.assert_allclose(rows, 1, atol=1e-9)


def test_the_way_through_a_network_is_the_best_of_all_ways():
    log = np.log(RNG.dirichlet(np.ones(4), 5))
    network = Network(log[0], log[1:], np.arange(4))
    seen = np.log(RNG.random((5, 4)))
    best = max(
        network.log_start[way[0]] + seen[range(5), way].sum() + sum(network.log_step[a, b] for a, b in pairwise(way))
        for way in product(range(4), repeat=5)
    )
    score, states = most_likely(network, seen)
    assert score == pytest.approx(best)
    own = network.log_start[states[0]] + seen[range(5), states].sum()
    assert own + sum(network.log_step[a, b] for a, b in pairwise(states)) == pytest.approx(best)


def test_a_network_of_models_keeps_probability():
    heard = [sequences(), sequences()]
    models = [learn(begun(own, 3, 1, all_follow=False), own, 3)[0] for own in heard]
    network = composed(models, np.array([0.6, 0.4]), np.array([[0.1, 0.9], [0.7, 0.3]]), 1.0)
    np.testing.assert_allclose(np.exp(network.log_step).sum(axis=1), 1, atol=1e-9)
    np.testing.assert_allclose(np.exp(network.log_start).sum(), 1)


def test_short_stretches_go_to_the_one_before():
    track = np.array([5, 1, 1, 1, 2, 2, 1, 1, 1, 3])
    np.testing.assert_array_equal(without_short(track, 3), [1] * 10)
    np.testing.assert_array_equal(without_short(track, 2), [1, 1, 1, 1, 2, 2, 1, 1, 1, 1])
    assert runs_of(np.array([4, 4, 2])) == [(0, 2, 4), (2, 3, 2)]


def test_the_curve_passes_its_key_points_and_is_smooth():
    angles = np.repeat(RNG.uniform(-0.3, 0.3, (20, 3)), 10, axis=0)
    curve = curve_through(angles, np.zeros_like(angles), 361, 120.0, RNG)
    np.testing.assert_allclose(to_angles(from_rotvec(curve[::20])), angles[::10][: len(curve[::20])], atol=1e-9)
    assert np.abs(np.diff(curve, n=2, axis=0)).max() < 0.02
    moved = curve_through(angles, np.full_like(angles, 0.01), 361, 120.0, np.random.default_rng(1))
    assert 0 < np.abs(to_angles(from_rotvec(moved)) - to_angles(from_rotvec(curve))).max() < 0.03
    assert from_angles(angles).shape == (200, 4)
