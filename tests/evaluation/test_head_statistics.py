"""Distances of the ways in which heads move."""

import numpy as np
import pytest
from nodding import nodding

from facesynth.evaluation.head_statistics import distances, pauses, take_apart


def samples(numbers, change=lambda head: head):
    found = []
    for number in numbers:
        speech, motion = nodding(number)
        motion.head[:] = change(motion.head)
        found.append(take_apart(motion, speech))
    return found


def test_a_head_is_like_itself_and_unlike_one_that_moves_thrice_as_far():
    own = samples(range(6))
    same, wilder = distances(own, own), distances(samples(range(6), lambda head: 3 * head), own)
    for name in ("speed in speech", "range", "spectrum"):
        assert same[name] == pytest.approx(0, abs=1e-12)
    assert wilder["range"] == pytest.approx(1 - 0 / 6, abs=0.35)
    assert wilder["speed in speech"] > 0.2
    assert wilder["spectrum"] == pytest.approx(0, abs=0.02), "the same movement, larger"


def test_trembling_is_seen_in_the_spectrum():
    rng = np.random.default_rng(0)
    own = samples(range(6))
    assert distances(samples(range(6), lambda head: head + rng.normal(0, 0.1, head.shape)), own)["spectrum"] > 0.2


def test_shares_of_power_sum_to_one_and_a_pause_is_where_it_is_quiet():
    speech, motion = nodding(0)
    assert take_apart(motion, speech).power.sum() == pytest.approx(1)
    speech.audio[: len(speech.audio) // 2] *= 1e-4
    quiet = pauses(speech, 60.0, 120)
    assert quiet[5:50].all()
    assert not quiet[70:].any()
