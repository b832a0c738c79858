"""Statistics of eyes, by known answers."""

import numpy as np
import pytest

from facesynth.evaluation.eyes import (
    averaged,
    blink_statistics,
    distances,
    fixation_statistics,
    fixations,
    gaze_statistics,
    pooled,
)

FPS = 60.0


def stepped(*degrees, hold=60):
    return np.radians(np.repeat(np.array(degrees, float), hold, axis=0))


def test_rests_less_than_two_degrees_apart_are_one():
    gaze = stepped((0, 0), (10, 0), (11.5, 0), (0, 0), (5, 5))
    found = fixations(gaze, FPS)
    assert [(one.start, one.stop) for one in found] == [(0, 60), (60, 180), (180, 240), (240, 300)]
    measured = fixation_statistics(gaze, FPS)
    assert measured["fixation, s"] == pytest.approx([2.0, 1.0])
    assert measured["shift, °"] == pytest.approx([10.75, 10.75, np.hypot(5, 5)])


def test_blinks_that_the_ends_cut_off_are_not_timed():
    opening = np.ones(600)
    for start in (0, 120, 300, 594):
        opening[start : start + 12] = 0.0
    measured = blink_statistics(opening, FPS)
    assert measured["blink, s"] == pytest.approx([0.2, 0.2])
    assert measured["between blinks, s"] == pytest.approx([3.0, 294 / FPS])
    assert measured["blinks a minute"] == pytest.approx([18.0])


def test_a_swing_has_its_frequency_and_its_way_with_the_head():
    times_s = np.arange(1200) / FPS
    swing = 0.1 * np.sin(2 * np.pi * times_s)
    head = np.zeros((1200, 6))
    head[:, 1] = -swing
    measured = gaze_statistics(np.column_stack([swing, np.zeros(1200)]), head, FPS)
    assert measured["spectrum, Hz"] == pytest.approx(1.0, abs=0.26)
    assert measured["with the head"] == pytest.approx(-1.0)
    assert measured["speed, °/s"].max() == pytest.approx(np.degrees(0.1 * 2 * np.pi), rel=0.01)


def test_equal_samples_are_not_apart_and_what_never_happens_is():
    one = fixation_statistics(stepped((0, 0), (10, 0), (0, 0), (4, 0)), FPS)
    assert set(distances(one, one).values()) == {0.0}
    never = {name: np.zeros(0) for name in one}
    assert set(distances(never, one).values()) == {1.0}
    assert len(pooled([one, one])["shift, °"]) == 2 * len(one["shift, °"])


def test_an_average_makes_a_jump_a_ramp():
    ramp = averaged(stepped((0, 0), (7, 0)), 7)
    assert (np.diff(np.degrees(ramp[:, 0])) > 0.5).sum() == 7
