"""Making the truth worse, step by step, moves the right metrics the right way."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from talking_points import FPS, face, moved, phones, talk

from facesynth.evaluation.lips import closure_rate, closure_threshold, false_closure_rate
from facesynth.evaluation.metrics import Case, metric

TRACK = phones(("pau", 0.2), *[(label, 0.4 + 0.2 * i) for i, label in enumerate(["m", "aa", "b", "ay", "p", "ah"] * 3)])


def values(name, synthesised):
    truth = talk()
    threshold = closure_threshold([(truth, TRACK)])
    return [metric(name).measure(Case(motion, truth, TRACK, threshold)) for motion in synthesised]


def noisy():
    noise = np.random.default_rng(0).normal(size=talk().frames.shape)
    return [moved(talk(), talk().frames + size * noise) for size in (0, 0.2, 0.5, 1, 2)]


def delayed():
    return [talk(delay_s=delay) for delay in (0, 0.02, 0.04, 0.08)]


def smoothed():
    return [talk()] + [moved(talk(), gaussian_filter1d(talk().frames, sigma, axis=0)) for sigma in (1, 3, 6, 12)]


ERRORS = ["marker_error", "marker_error_centred", "deng_error", "unit_cube_rms", "lve", "lve_sq", "lve_centred", "velocity_error"]
RISING = [
    *[(worse, name) for worse in (noisy, delayed, smoothed) for name in ERRORS],
    (noisy, "jerk_ratio"),
    (noisy, "energy_ratio"),
    (delayed, "lip_lag"),
    (delayed, "lip_extrema_lag"),
    (smoothed, "fdd"),
    (smoothed, "fdd_abs"),
]
FALLING = [
    *[(worse, name) for worse in (noisy, delayed, smoothed) for name in ("lip_gap_corr", "lip_gap_ccc")],
    (smoothed, "jerk_ratio"),
    (smoothed, "energy_ratio"),
    (noisy, "fdd"),
]


@pytest.mark.parametrize(("worse", "name"), RISING)
def test_rises(worse, name):
    assert (np.diff(values(name, worse())) > 0).all()


@pytest.mark.parametrize(("worse", "name"), FALLING)
def test_falls(worse, name):
    assert (np.diff(values(name, worse())) < 0).all()


def test_smoothing_loses_closures_and_opens_nothing_that_was_shut():
    t = np.arange(240) / FPS
    truth = face(5 + (5 - t) * np.cos(2 * np.pi * (t - 0.1) / 0.4))  # smallest in the middle of each p, b, m
    threshold = closure_threshold([(truth, TRACK)])
    worse = [truth] + [moved(truth, gaussian_filter1d(truth.frames, sigma, axis=0)) for sigma in (1, 2, 4, 8)]
    rates = [closure_rate(motion, TRACK, threshold) for motion in worse]
    assert (np.diff(rates) <= 0).all()
    assert rates[0] >= 0.9
    assert rates[-1] == 0


@pytest.mark.parametrize(("held", "way"), [(8.0, 1), (1.0, -1)], ids=["open", "shut"])
def test_noise_on_a_mouth_that_is_held_moves_closure_one_way(held, way):
    """The smallest gap falls with noise; each vowel's median moves one way, so it passes the threshold once at most."""
    still = face(np.full(240, held))
    noise = np.random.default_rng(1).normal(size=still.frames.shape)
    worse = [moved(still, still.frames + size * noise) for size in (0, 0.5, 1, 2, 4, 40)]
    closed = [closure_rate(motion, TRACK, 3.0) for motion in worse]
    false = [false_closure_rate(motion, TRACK, 3.0) for motion in worse]
    assert (np.diff(closed) >= 0).all()
    assert (np.diff(false) * way >= 0).all()
    assert (closed[0], false[0]) == ((0, 0) if way > 0 else (1, 1))
    assert closed[-1] == 1
    assert 0 < false[-1] < 1


def test_delay_alone_leaves_energy_as_it_is():
    assert values("energy_ratio", delayed()) == pytest.approx([1] * 4, abs=0.02)
