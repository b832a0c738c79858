import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from facesynth.inference.anime_graph.lowpass import LowPass
from facesynth.methods.anime_graph.lowpass import cutoffs_hz, energy_spectrum

FPS = 120.0
T = np.arange(1200) / FPS


def share_above(motion, cutoff):
    frequencies, energy = energy_spectrum([motion], FPS)
    return energy[frequencies > cutoff].sum(axis=0) / energy.sum(axis=0)


def test_cutoff_lies_just_above_the_movement():
    motion = np.stack([np.sin(2 * np.pi * 4 * T), np.sin(2 * np.pi * 15 * T) + 3], axis=1)
    cutoffs = cutoffs_hz([motion], FPS)
    assert 4 <= cutoffs[0] <= 7
    assert 15 <= cutoffs[1] <= 18


def test_jumps_go_and_the_movement_stays():
    rng = np.random.default_rng(0)
    captured = gaussian_filter1d(rng.normal(size=(3600, 2)), 4, axis=0)
    cutoffs = cutoffs_hz([captured], FPS)
    smooth = LowPass(cutoffs, FPS)(captured)
    assert (smooth.var(axis=0) / captured.var(axis=0)).min() > 0.95
    jumpy = captured + 1.5 * captured.std() * (np.arange(3600) // 30 % 2)[:, None]
    for column, cutoff in enumerate(cutoffs):
        assert share_above(LowPass(cutoffs, FPS)(jumpy)[:, [column]], cutoff).max() < 0.01


def test_nothing_is_shifted_and_the_ends_hold():
    motion = np.sin(2 * np.pi * 1.3 * T)[:, None] + 2
    np.testing.assert_allclose(LowPass(np.array([12.0]), FPS)(motion), motion, atol=0.02)


@pytest.mark.parametrize("length", [1, 2, 3, 7])
def test_short_motion_survives(length):
    motion = np.ones((length, 1)) * 5
    np.testing.assert_allclose(LowPass(np.array([5.0]), FPS)(motion), motion)
    np.testing.assert_array_equal(LowPass(np.array([60.0]), FPS)(motion), motion)
