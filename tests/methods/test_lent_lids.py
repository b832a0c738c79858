"""Lids of somebody else: as many blinks go with shifts of the gaze as theirs did."""

import numpy as np
import pytest
from corpora import tiny_layout

from facesynth.inference.eyes import at_rest
from facesynth.inference.motion import Motion
from facesynth.methods.eyes.lent_lids import between_rests, shared_blinks, together, with_lids
from facesynth.methods.eyes.patch_size import SHUT
from facesynth.motion.lids import Lids

FPS = 60.0
WHOLE = Lids(0.0, 1.0)


def blinking(share, seconds=400.0, seed=0):
    """Eyes that shift by 8° every 2 s and blink every 2 s, this share of the blinks with a shift, the others far from one."""
    rng, count = np.random.default_rng(seed), round(seconds * FPS)
    period = round(2 * FPS)
    gaze = np.zeros((count, 2))
    gaze[:, 0] = np.radians(8) * ((np.arange(count) // period) % 2)
    lids = np.ones(count)
    for start in range(period, count - period, period):
        at = start - 4 if rng.random() < share else start + period // 2
        lids[at : at + 9] = 0.0
    still = at_rest(tiny_layout(), count, FPS)
    return Motion(still.frames, FPS, still.layout, None, np.column_stack([lids, gaze]).astype(np.float32))


@pytest.mark.parametrize(("share", "least", "most"), [(0.0, 0.0, 0.0), (0.5, 0.2, 0.5), (1.0, 0.95, 1.0)])
def test_the_share_of_blinks_that_come_with_a_shift_is_found_and_not_too_large(share, least, most):
    # what is beyond chance: a shift may fall into a blink by chance as often as into a stretch without one
    assert least <= shared_blinks([blinking(share)], WHOLE) <= most


def test_nothing_is_shared_where_nobody_blinks():
    awake = blinking(0.0)
    assert shared_blinks([Motion(awake.frames, FPS, awake.layout, None, awake.eyes * (0, 1, 1) + (1, 0, 0))], WHOLE) == 0


def blinks_of(lids):
    return np.flatnonzero((lids[1:] < SHUT) & (lids[:-1] >= SHUT)) + 1


def test_blinks_are_moved_to_shifts_and_none_is_lost():
    eyes = blinking(0.0, 60.0).eyes.astype(np.float64)
    for share, least, most in ((0.0, 0.0, 0.0), (1.0, 0.95, 1.0)):
        moved = together(eyes[:, 0], eyes[:, 1:], share, FPS, np.random.default_rng(0))
        starts = blinks_of(moved)
        assert len(starts) == len(blinks_of(eyes[:, 0]))
        assert least <= np.mean([min(at % 120, 120 - at % 120) <= 2 for at in starts]) <= most
        assert (moved < SHUT).sum() == (eyes[:, 0] < SHUT).sum()


def test_lent_lids_blink_as_often_as_those_that_lent_them_and_with_the_gaze():
    gaze = blinking(0.0, 100.0).eyes.astype(np.float64) * (0, 1, 1) + (1, 0, 0)
    made = with_lids([gaze], [blinking(1.0, 60.0)], seed=1)[0]
    assert np.array_equal(made[:, 1:], gaze[:, 1:])
    starts = blinks_of(made[:, 0])
    assert 60 * len(starts) / 100 == pytest.approx(30, abs=6)
    near = np.mean([min(at % 120, 120 - at % 120) <= 3 for at in starts])
    assert near > 0.7


def test_of_a_lender_who_blinks_often_blinks_are_left_out_and_half_open_dips_all():
    gaze, lender = blinking(0.0, 400.0).eyes.astype(np.float64) * (0, 1, 1) + (1, 0, 0), blinking(1.0, 60.0)
    lender.eyes[60::120, 0] = 0.7
    lids = with_lids([gaze], [lender], seed=1, most=12.0)[0][:, 0]
    assert 60 * len(blinks_of(lids)) / 400 == pytest.approx(12, abs=4)
    assert not ((lids > 0.5) & (lids < 0.9)).any()


def test_lids_rest_fully_open_wherever_the_lender_rests():
    lids = np.linspace(1.0, 0.6, 600)[:, None]
    lids[300:309] = 0.0
    open_ = between_rests(lids, FPS)[:, 0]
    assert np.median(open_) == pytest.approx(1.0, abs=0.02)
    assert (open_[300:309] == 0).all()


def test_an_open_eye_is_a_persons_own_ninetieth_percentile():
    tired = blinking(0.0, 60.0)
    half = Motion(tired.frames, FPS, tired.layout, None, tired.eyes * np.array([0.8, 1, 1], np.float32))
    assert Lids.of([half]).opened == pytest.approx(0.8)
    assert np.median(Lids.of([half]).opening(half)) == pytest.approx(1.0)
