import numpy as np
import pytest

from facesynth.inference.efase.assembly import smooth_joint
from facesynth.inference.warp import time_warp


def smoothed(frames, *how):
    after = frames.copy()
    smooth_joint(after, *how)
    return after


def step(count, joint, height=3.0):
    return np.where(np.arange(count) < joint, 0.0, height)[:, None] * np.ones(2)


@pytest.mark.parametrize(("count", "joint"), [(20, 10), (4, 2), (3, 1), (9, 1), (6, 5)])
def test_a_jump_shrinks_and_no_new_one_appears(count, joint):
    before = step(count, joint)
    after = smoothed(before, joint, 3, np.ones(count))
    assert np.abs(np.diff(after, axis=0)).max() < 3.0
    outside = np.r_[0 : max(joint - 3, 0), min(joint + 3, count) : count]
    np.testing.assert_array_equal(after[outside], before[outside])
    np.testing.assert_allclose(after[[max(joint - 3, 0), min(joint + 3, count) - 1]][:: count - 1], before[[0, -1]][:: count - 1])


def test_a_straight_line_is_left_alone():
    line = np.arange(20.0)[:, None] * np.ones(3)
    np.testing.assert_allclose(smoothed(line, 9, 4, np.ones(20)), line, atol=1e-6)


def test_heavy_frames_move_less():
    frames = step(20, 10)
    heavy = np.where(np.arange(20) < 10, 4.0, 0.5)
    moved = np.abs(smoothed(frames, 10, 3, heavy) - frames).sum(axis=1)
    assert moved[7:10].sum() < moved[10:13].sum()


def test_two_frames_cannot_be_smoothed():
    np.testing.assert_array_equal(smoothed(step(2, 1), 1, 3, np.ones(2)), step(2, 1))


def test_warp_keeps_ends_and_length():
    frames = np.random.default_rng(0).normal(size=(7, 2))
    longer = time_warp(frames, 19)
    assert longer.shape == (19, 2)
    np.testing.assert_allclose(longer[[0, -1]], frames[[0, -1]])
    np.testing.assert_allclose(time_warp(longer, 7), frames, atol=1e-12)


def test_warp_of_and_to_a_single_frame():
    np.testing.assert_array_equal(time_warp(np.ones((1, 2)), 3), np.ones((3, 2)))
    np.testing.assert_array_equal(time_warp(np.arange(5.0)[:, None], 1), [[2.0]])
