"""Measures of drawn mouths on pictures whose motion is known."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, shift

from facesynth.evaluation.drawn_mouth import rigid_rest, steps, sudden, teeth

SIDE = 40


@pytest.fixture(scope="module")
def teeth_picture():
    return 120 + 300 * gaussian_filter(np.random.default_rng(0).normal(size=(SIDE, SIDE)), 2.5)


@pytest.fixture(scope="module")
def mouth():
    y, x = np.mgrid[:SIDE, :SIDE]
    return ((x - 20) / 14) ** 2 + ((y - 20) / 7) ** 2 < 1


@pytest.mark.parametrize("moved", [(0.0, 0.0), (2.0, -1.0), (-1.25, 0.5)])
def test_teeth_that_are_shifted_leave_nothing(teeth_picture, mouth, moved):
    assert rigid_rest(teeth_picture, shift(teeth_picture, moved, order=1, mode="nearest"), mouth) < 1.5


def test_teeth_that_are_stretched_or_replaced_leave_something(teeth_picture, mouth):
    rows = np.linspace(10, 30, SIDE).round().astype(int)
    stretched, other = teeth_picture[rows], teeth_picture[::-1, ::-1]
    assert rigid_rest(teeth_picture, stretched, mouth) > 6
    assert rigid_rest(teeth_picture, other, mouth) > 6


def test_teeth_that_come_and_go_blink(mouth):
    dark, bright = np.full((SIDE, SIDE), 40.0), np.full((SIDE, SIDE), 200.0)
    half = np.where(np.arange(SIDE)[:, None] < 20, bright, dark)
    inside = np.repeat(mouth[None], 4, axis=0)
    assert teeth(np.stack([dark, bright, dark, bright]), inside).blinking == 1
    assert teeth(np.stack([half] * 4), inside).blinking == 0
    assert teeth(np.stack([half] * 4), inside).left_over == 0


def test_the_light_does_not_count(teeth_picture, mouth):
    rows = np.linspace(10, 30, SIDE).round().astype(int)
    clip, inside = np.stack([teeth_picture, teeth_picture[rows]]), np.repeat(mouth[None], 2, axis=0)
    plain, dim = teeth(clip, inside), teeth(0.4 * clip + 20, inside)
    assert dim.left_over == pytest.approx(plain.left_over)
    assert dim.blinking == pytest.approx(plain.blinking)
    assert plain.left_over > 0.1


def test_a_shut_mouth_has_no_teeth():
    found = teeth(np.zeros((4, SIDE, SIDE)), np.zeros((4, SIDE, SIDE), bool))
    assert np.isnan(found.left_over)
    assert np.isnan(found.blinking)


def test_sudden_steps_are_counted_against_the_recorded_ones():
    recorded = steps(np.cumsum(np.ones((11, 4, 4)), axis=0))
    drawn = steps(np.cumsum(np.array([1.0] * 8 + [20.0, 1, 1])[:, None, None] * np.ones((11, 4, 4)), axis=0))
    assert recorded.tolist() == [1.0] * 10
    assert sudden(recorded, recorded) == 0
    assert sudden(drawn, recorded) == pytest.approx(0.1)
