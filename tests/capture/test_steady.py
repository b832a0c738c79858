import numpy as np
import pytest

from facesynth.capture.motion import CUTOFF_HZ, steadied

FPS = 60


def test_slow_movement_is_neither_delayed_nor_weakened_and_trembling_goes():
    seconds = np.arange(240) / FPS
    slow = np.sin(2 * np.pi * 2 * seconds)
    tremble = 0.2 * np.sin(2 * np.pi * 24 * seconds)
    steady = steadied((slow + tremble)[:, None], FPS)[20:-20, 0]
    assert np.abs(steady - slow[20:-20]).max() < 0.02


@pytest.mark.parametrize("fps", [25, 30, 60, 120])
def test_lips_that_shut_for_80_ms_stay_shut(fps):
    seconds = np.arange(round(2 * fps)) / fps
    gap = np.where(np.abs(seconds - 1) < 0.04, 0.0, np.clip((np.abs(seconds - 1) - 0.04) / 0.06, 0, 1))
    steady = steadied(gap[:, None], fps)[:, 0]
    assert steady.min() < 0.08
    assert abs(seconds[steady.argmin()] - 1) <= 1 / fps


def test_gaps_stay_gaps_and_part_the_signal():
    signal = np.r_[np.zeros(30), np.full(5, np.nan), np.ones(30), np.nan, 7.0][:, None]
    steady = steadied(signal, FPS)
    assert np.array_equal(np.isnan(steady), np.isnan(signal))
    assert np.abs(steady[:30]).max() < 1e-12
    assert np.allclose(steady[35:65], 1)
    assert steady[-1, 0] == 7


def test_a_slow_camera_is_left_alone_and_nothing_is_changed_in_place():
    noise = np.random.default_rng(0).standard_normal((40, 3))
    before = noise.copy()
    assert np.array_equal(steadied(noise, 2 * CUTOFF_HZ), noise)
    assert not np.array_equal(steadied(noise, 60), noise)
    assert np.array_equal(noise, before)
    assert steadied(noise[:0], 60).shape == (0, 3)
