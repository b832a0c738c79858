"""What eyes do with a place to look at, by known answers."""

import numpy as np
import pytest

from facesynth.inference.gaze import REACH_RAD, TURN_RAD, gaze_shifts, head_turns, quick_turns, within_reach

FPS = 60.0


def stepped(*degrees, hold=90):
    """A gaze that rests at each place and jumps to the next within a frame."""
    return np.radians(np.repeat(np.array(degrees, float), hold, axis=0))


def test_every_jump_is_a_shift_of_its_size():
    shifts = gaze_shifts(stepped((0, 0), (10, 0), (10, -4)), FPS)
    assert [(shift.start, shift.stop) for shift in shifts] == [(89, 90), (179, 180)]
    assert np.degrees([shift.step for shift in shifts]) == pytest.approx(np.array([(10, 0), (0, -4)]))


def test_a_slow_look_is_no_shift():
    assert gaze_shifts(np.radians(np.linspace((0, 0), (20, 0), 120)), FPS) == []


def test_narrow_shifts_leave_the_head_still():
    assert not head_turns(stepped((0, 0), (14, 0), (0, 0)), FPS).any()


def test_of_a_wide_shift_the_head_takes_what_is_beyond_fifteen_degrees_and_returns():
    turns = np.degrees(head_turns(stepped((0, 0), (25, 0), hold=400), FPS))
    assert not turns[:400].any()
    assert turns[:, 0].max() == pytest.approx(25 - np.degrees(TURN_RAD), abs=0.05)
    assert 400 + 0.35 * FPS < turns[:, 0].argmax() < 400 + 0.5 * FPS
    assert turns[-1, 0] < 1
    assert not turns[:, 1].any()


def test_a_slow_sway_of_the_head_is_followed_and_a_quick_one_is_not():
    times_s = np.arange(1200) / FPS
    head = np.zeros((1200, 6))
    head[:, 1] = 0.1 * np.sin(2 * np.pi * times_s / 40)
    assert np.abs(quick_turns(head, FPS)[300:900]).max() < 0.01
    head[:, 1] = 0.1 * np.sin(2 * np.pi * times_s * 2)
    assert quick_turns(head, FPS)[300:900, 0] == pytest.approx(head[300:900, 1], abs=1e-3)


def test_angles_are_to_the_left_and_up():
    head = np.zeros((600, 6))
    head[300, :3] = (-0.1, 0.2, 0.0)  # a turn about x takes the face down, one about y to the performer's left
    assert quick_turns(head, FPS)[300] == pytest.approx((0.2, 0.1), abs=0.01)


def test_eyes_stop_at_their_reach_in_the_direction_they_look():
    gaze = np.radians([(10.0, 5.0), (80.0, 0.0), (0.0, -60.0), (70.0, 50.0)])
    inside = within_reach(gaze)
    assert np.array_equal(inside[0], gaze[0])
    assert np.abs(inside[1:3]).max(axis=1) == pytest.approx(REACH_RAD)
    assert np.arctan2(*inside[3]) == pytest.approx(np.arctan2(*gaze[3]))
    assert np.hypot(*(inside / REACH_RAD).T).max() <= 1 + 1e-12
