import itertools

import numpy as np
import pytest
from simulated_lds import errors, pole_error, random_truth, recording, transfer_error

from facesynth.inference.errors import FacesynthError
from facesynth.methods.lds.deterministic import fit_inputs, observability, shift_invariance, stabilised
from facesynth.methods.lds.identification import fitting_rows, identify
from facesynth.methods.lds.regression import solve, triangle
from facesynth.methods.lds.system import Clip, Deterministic, Stochastic

# Medians that a prototype reached: deterministic poles, F, stochastic poles, G, D, 3 - kurtosis.
REACHED = {
    1_000: (0.003, 0.028, 0.021, 0.097, 0.073, 0.5),
    10_000: (0.0009, 0.0076, 0.007, 0.025, 0.018, 0.1),
    100_000: (0.0005, 0.0038, 0.0012, 0.0145, 0.0055, 0.04),
}


def median_errors(frames, rows, seeds=10):
    return np.median([errors(t := random_truth(seed), [recording(t, frames, seed + 100)], rows) for seed in range(seeds)], axis=0)


@pytest.mark.parametrize(("frames", "rows"), [(1_000, 10), pytest.param(10_000, 15, marks=pytest.mark.slow)])
def test_simulated_systems_are_found(frames, rows):
    assert (median_errors(frames, rows) < 1.5 * np.array(REACHED[frames])).all()


@pytest.mark.slow
def test_errors_fall_with_the_length_of_the_recording():
    short, long = median_errors(10_000, 15), median_errors(100_000, 20)
    assert (long < 1.5 * np.array(REACHED[100_000])).all()
    assert (long < short / 2).all()


def test_clips_of_different_lengths_are_used_jointly():
    truth = random_truth(3)
    whole = recording(truth, 4_000, 0)
    cuts = [0, 900, 960, 1_000, 1_005, 2_400, 4_000]
    clips = [Clip(whole.u[a:b], whole.y[a:b]) for a, b in itertools.pairwise(cuts)]
    system = identify(clips, 10, (2, 2))
    assert len(system.starts) == len(clips)
    assert transfer_error(system.deterministic, truth.deterministic) < 0.05
    assert transfer_error(system.stochastic, truth.stochastic) < 0.15


def test_the_deterministic_part_is_exact_without_noise():
    truth = random_truth(1)
    clips = [_noiseless(truth, frames, seed) for seed, frames in enumerate((150, 90))]
    gamma, singular = observability(clips, 6)
    A, C = shift_invariance(gamma, 3, 2)
    system, starts = fit_inputs(A, C, clips, None)
    assert singular[2] < 1e-8 * singular[1]
    assert pole_error(A, truth.deterministic.A) < 1e-8
    assert transfer_error(system, truth.deterministic) < 1e-8
    np.testing.assert_allclose(system.simulate(clips[1].u, starts[1]), clips[1].y, atol=1e-8)


def test_another_identification_package_finds_the_same_deterministic_part():
    nfoursid = pytest.importorskip("nfoursid.nfoursid")
    pandas = pytest.importorskip("pandas")
    clip = _noiseless(random_truth(4), 400, 5)
    columns = {f"u{j}": column for j, column in enumerate(clip.u.T)} | {f"y{i}": column for i, column in enumerate(clip.y.T)}
    other = nfoursid.NFourSID(pandas.DataFrame(columns), ["y0", "y1", "y2"], ["u0", "u1"], num_block_rows=8)
    other.subspace_identification()
    found, _ = other.system_identification(rank=2)
    theirs = Deterministic(*(np.asarray(matrix, np.float64) for matrix in (found.a, found.b, found.c, found.d)))
    ours = identify([clip], 8, (2, 1)).deterministic
    assert transfer_error(ours, theirs) < 1e-6
    assert pole_error(ours.A, theirs.A) < 1e-6


def test_every_model_is_stable_and_minimum_phase():
    for seed in range(12):
        rng = np.random.default_rng(seed)
        walk = Clip(rng.normal(size=(300, 2)), rng.normal(size=(300, 3)).cumsum(axis=0))
        system = identify([walk], 8, (4, 4))
        assert all(max(moduli) < 1 for moduli in system.poles().values())


def test_unstable_eigenvalues_are_moved_inside_and_reported():
    rotation = np.array([[0.0, -1.1], [1.1, 0.0]])
    A, moved = stabilised(np.block([[rotation, np.ones((2, 1))], [np.zeros((1, 2)), np.array([[0.5]])]]))
    np.testing.assert_allclose(np.sort(np.abs(np.linalg.eigvals(A))), [0.5, 0.995, 0.995])
    np.testing.assert_allclose(moved, [1.1, 1.1])
    same, none = stabilised(rotation / 2)
    assert none == ()
    np.testing.assert_array_equal(same, rotation / 2)


def test_an_unstable_fit_is_repaired_refitted_and_reported():
    for seed in range(40):
        rng = np.random.default_rng(seed)
        clip = Clip(rng.normal(size=(120, 1)), rng.normal(size=(120, 2)).cumsum(axis=0).cumsum(axis=0))
        system = identify([clip.centred()], 5, (3, 2))
        if system.repaired:
            break
    assert min(system.repaired) >= 1
    assert max(system.poles()["A_d"]) < 1


def test_inputs_are_fitted_again_for_moved_eigenvalues():
    truth = random_truth(2)
    clip = _noiseless(truth, 300, 0)
    unstable = 1.02 * truth.deterministic.A / np.abs(np.linalg.eigvals(truth.deterministic.A)).max()
    A, moved = stabilised(unstable)
    assert moved
    before, starts = fit_inputs(unstable, truth.deterministic.C, [clip], None)
    after, again = fit_inputs(A, truth.deterministic.C, [clip], None)
    kept = Deterministic(A, before.B, before.C, before.D)
    errors = [np.abs(clip.y - system.simulate(clip.u, start[0])).mean() for system, start in ((kept, starts), (after, again))]
    assert errors[1] < 0.9 * errors[0]


def test_inverse_system_returns_the_innovations():
    truth = random_truth(0)
    e = np.random.default_rng(0).normal(size=(200, 3))
    back, _ = truth.stochastic.innovations(truth.stochastic.simulate(e)[:, :, None])
    np.testing.assert_allclose(back[:, :, 0], e, atol=1e-10)


def test_innovations_in_pieces_are_those_of_the_whole():
    truth = random_truth(0)
    y = np.random.default_rng(0).normal(size=(200, 3, 2))
    whole, _ = truth.stochastic.innovations(y)
    first, state = truth.stochastic.innovations(y[:70])
    second, _ = truth.stochastic.innovations(y[70:], state)
    np.testing.assert_allclose(np.concatenate([first, second]), whole)


def test_white_noise_has_no_gain():
    rng = np.random.default_rng(0)
    clip = Clip(rng.normal(size=(20_000, 1)), rng.normal(size=(20_000, 2)))
    stochastic = identify([clip], 5, (1, 1)).stochastic
    flat = Stochastic(np.zeros((1, 1)), np.zeros((1, 2)), np.zeros((2, 1)), np.eye(2))
    assert transfer_error(stochastic, flat) < 0.05
    np.testing.assert_allclose(stochastic.covariance, np.eye(2), atol=0.05)


def test_least_squares_by_blocks_is_least_squares():
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(100, 4)), rng.normal(size=(100, 2))
    rows = np.hstack([x, y])
    blocks = triangle([rows[:3], rows[3:50], rows[50:]])
    np.testing.assert_allclose(solve(blocks, 4), np.linalg.lstsq(x, y, rcond=None)[0])


def test_too_few_frames_are_refused_with_how_many_are_needed():
    clip = Clip(np.zeros((30, 4)), np.zeros((30, 6)))
    with pytest.raises(FacesynthError, match=r"30 frames in 1 clips are too few.*at least 123 frames"):
        fitting_rows([clip], 10)
    enough = Clip(np.zeros((123, 4)), np.zeros((123, 6)))
    assert fitting_rows([enough], 10) == 2


def test_orders_that_do_not_fit_are_refused():
    clip = Clip(np.zeros((300, 2)), np.zeros((300, 2)))
    with pytest.raises(FacesynthError, match="1 to 4"):
        identify([clip], 3, (5, 1))


def _noiseless(truth, frames, seed):
    clip = recording(truth, frames, seed)
    return Clip(clip.u, truth.deterministic.simulate(clip.u, np.array([1.0, -2.0])))
