from dataclasses import replace

import numpy as np
import pytest
import torch

from facesynth.inference.expectation import Reading, Said, Standard
from facesynth.methods.learn.linear_path import SIDE, LinearPath
from facesynth.methods.learn.regression import Moments
from facesynth.methods.learn.windows import Recording

RNG = np.random.default_rng(5)
BANDS, FPS = 4, 25.0
READING = Reading(Standard(np.zeros(BANDS, np.float32), np.ones(BANDS, np.float32)), FPS, False, 1)
SAID = Said.numbered([0], np.array([np.inf]), [0], 1)


def recording(weights, offset, present=1.0):
    """Poses that are a linear map of the sound `offset` frames from them."""
    bands = RNG.normal(size=(400, BANDS)).astype(np.float32)
    told = READING.told(bands, SAID, (np.arange(100) + offset) / FPS).reshape(100, -1, BANDS).mean(axis=1)
    return Recording(bands, (), SAID, (told @ weights + 1).astype(np.float32), np.full(100, present, np.float32), FPS)


@pytest.mark.parametrize(("offset", "ahead"), [(0, 0), (-3, 2), (2, 2), (4, 18)])
def test_poses_that_are_linear_in_the_sound_are_found_whatever_may_be_looked_ahead(offset, ahead):
    weights = RNG.normal(size=(BANDS, 3)).astype(np.float32)
    some, path = [recording(weights, offset) for _ in range(6)], LinearPath()
    path.learn(some, READING, ahead)
    told = READING.told(some[0].bands, SAID, np.arange(100 + ahead) / FPS)
    found = path(torch.from_numpy(told), ahead)[ahead:].numpy()  # the input runs ahead
    inside = slice(2 * SIDE, -2 * SIDE)
    np.testing.assert_allclose(found[inside], some[0].poses[inside], atol=0.1)


def test_frames_that_were_not_recorded_teach_nothing():
    weights = RNG.normal(size=(BANDS, 2)).astype(np.float32)
    one, two = LinearPath(), LinearPath()
    some = [recording(weights, 0) for _ in range(4)]
    one.learn(some, READING, 3)
    broken = recording(-9 * weights, 0, present=0.0)
    two.learn([*some, broken], READING, 3)
    assert torch.equal(one.weight, two.weight)


def test_the_penalty_is_chosen_by_voices_that_were_not_met():
    """A band that tells all of it in the talker's own sound, and nothing in changed ones, is drawn to nothing by the penalty."""

    def heard_otherwise(changed):
        weights = np.ones((BANDS, 1), np.float32)
        weights[1:] = 0.0
        some = [recording(weights, 0) for _ in range(10)]
        others = [np.float16(one.bands * [-1, 1, 1, 1]) for one in some]
        given = [replace(one, others=(other,) * changed) for one, other in zip(some, others, strict=True)]
        path = LinearPath()
        path.learn(given, READING, 3)
        return float(path.weight.float().abs().sum())

    assert heard_otherwise(1) < 0.1 * heard_otherwise(0)


def test_each_emotion_has_poses_of_its_own():
    """Poses that are a linear map of the sound and lie elsewhere in each of two emotions, half of a recording in either."""
    reading = replace(READING, emotion_count=2)
    weights = RNG.normal(size=(BANDS, 3)).astype(np.float32)
    said = Said.numbered([0, 0], np.array([50 / FPS, np.inf]), [0, 1], 2)
    lie = np.repeat([[5.0, 0, 0], [0, -7.0, 0]], 50, axis=0).astype(np.float32)
    some = [replace(one, said=said, poses=one.poses + lie) for one in (recording(weights, 0) for _ in range(6))]
    path, ahead = LinearPath(), 4
    path.learn(some, reading, ahead)
    told = reading.told(some[0].bands, said, np.arange(100 + ahead) / FPS)
    found = path(torch.from_numpy(told), ahead)[ahead:].numpy()
    inside = slice(2 * SIDE, -2 * SIDE)
    np.testing.assert_allclose(found[inside], some[0].poses[inside], atol=0.15)


def test_a_corpus_that_could_hold_other_emotions_and_recorded_one_is_of_one():
    reading, said = replace(READING, emotion_count=4), Said.numbered([0], np.array([np.inf]), [0], 4)
    path = LinearPath()
    path.learn([replace(recording(np.ones((BANDS, 1), np.float32), 0), said=said) for _ in range(4)], reading, 3)
    assert not len(path.emotions)


def test_it_counts_half_where_there_are_several_emotions():
    calm, moved = LinearPath(), LinearPath()
    calm.learn([recording(np.ones((BANDS, 1), np.float32), 0)], READING, 3)
    moved.emotions = torch.zeros(2, 1)
    assert (calm.share, moved.share) == (0.4, 0.2)


def test_it_says_nothing_before_it_has_learned():
    assert not LinearPath().learned


def test_one_penalty_is_solved_as_all_of_them_are():
    sums, x = Moments.zero(5, 2), RNG.normal(size=(40, 5))
    sums.add(x, x @ RNG.normal(size=(5, 2)) + 3)
    for one, other in zip(sums.solution(0.1), sums.solutions([0.1])[0], strict=True):
        np.testing.assert_allclose(one, other, atol=1e-10)
