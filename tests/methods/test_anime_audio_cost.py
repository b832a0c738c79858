import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facesynth.inference.anime_graph.audio_cost import audio_costs, warp_path


def every_path(m, length):
    """All monotone warping paths from (0, 0) to (m-1, length-1)."""
    if (m, length) == (1, 1):
        return [[(0, 0)]]
    paths = []
    for dm, dl in ((1, 1), (1, 0), (0, 1)):
        if m - dm >= 1 and length - dl >= 1:
            paths += [[*p, (m - 1, length - 1)] for p in every_path(m - dm, length - dl)]
    return paths


@pytest.mark.parametrize(("m", "length"), list(itertools.product((1, 2, 4), (1, 3, 5))))
def test_equals_the_best_of_all_warpings(m, length):
    rng = np.random.default_rng(10 * m + length)
    wanted, heard = rng.normal(size=(m, 3)), rng.normal(size=(length, 3))
    best = min(every_path(m, length), key=lambda p: sum(np.linalg.norm(wanted[k] - heard[f]) for k, f in p))
    warped = [heard[[f for k, f in best if k == row]].mean(axis=0) for row in range(m)]
    cost = np.mean(np.linalg.norm(wanted - warped, axis=1))
    stop = np.array([length])
    assert audio_costs(wanted, heard, np.zeros(1, np.int64), stop)[0] == pytest.approx(cost)
    places = [np.mean([min(f for k, f in best if k == row), max(f for k, f in best if k == row)]) for row in range(m)]
    np.testing.assert_allclose(warp_path(wanted, heard), places)


def test_batch_is_the_same_as_one_by_one():
    rng = np.random.default_rng(0)
    features, wanted = rng.normal(size=(100, 9)), rng.normal(size=(8, 9))
    starts = np.array([0, 10, 50])
    stops = np.array([10, 17, 51])
    one_by_one = [
        audio_costs(wanted, features[a:b], np.array([0]), np.array([b - a]))[0] for a, b in zip(starts, stops, strict=True)
    ]
    np.testing.assert_allclose(audio_costs(wanted, features, starts, stops), one_by_one)


def test_a_slower_copy_costs_nothing():
    wanted = np.random.default_rng(1).normal(size=(6, 9))
    slower = np.repeat(wanted, 3, axis=0)
    assert audio_costs(wanted, slower, np.array([0]), np.array([18]))[0] == pytest.approx(0, abs=1e-12)
    np.testing.assert_allclose(warp_path(wanted, slower), np.arange(6) * 3 + 1)


def literal_matches(wanted, heard):
    """The pairs of frames that dynamic time-warping matches, cell by cell; of equal steps both, then the input alone."""
    apart = np.linalg.norm(wanted[:, None] - heard, axis=2)
    total, origin = np.full(apart.shape, np.inf), {}
    total[0, 0] = apart[0, 0]
    for k, f in itertools.product(*map(range, apart.shape)):
        before = [(k - 1, f - 1), (k - 1, f), (k, f - 1)]
        before = [cell for cell in before if min(cell) >= 0]
        if before:
            origin[k, f] = min(before, key=lambda cell: total[cell])
            total[k, f] = total[origin[k, f]] + apart[k, f]
    path = [(len(wanted) - 1, len(heard) - 1)]
    while path[-1] in origin:
        path.append(origin[path[-1]])
    return path


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 9999))
def test_warps_of_many_lengths_are_those_of_the_literal_algorithm(seed):
    rng = np.random.default_rng(seed)
    lengths = rng.integers(1, 15, 9)
    stops, features = np.cumsum(lengths), rng.standard_normal((int(lengths.sum()), 4))
    wanted = rng.standard_normal((int(rng.integers(1, 12)), 4))
    for start, stop, cost in zip(stops - lengths, stops, audio_costs(wanted, features, stops - lengths, stops), strict=True):
        heard = features[start:stop]
        matched = [[f for k, f in literal_matches(wanted, heard) if k == row] for row in range(len(wanted))]
        means = np.array([heard[frames].mean(axis=0) for frames in matched])
        assert cost == pytest.approx(np.linalg.norm(wanted - means, axis=1).mean())
        np.testing.assert_array_equal(warp_path(wanted, heard), [(min(frames) + max(frames)) / 2 for frames in matched])
