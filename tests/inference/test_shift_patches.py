"""Eyes that are joined where the gaze shifts: rests last as recorded, joins hide in shifts, the silent listen."""

import numpy as np
import pytest

from facesynth.inference.eyes import roles_of
from facesynth.inference.gaze import gaze_shifts
from facesynth.inference.shift_patches import EITHER, LISTENING, NEAR_RAD, SPEAKING, ShiftTexture
from facesynth.inference.speech import PhoneTrack

FPS = 60.0


def eyes(rests, places, seed=0):
    """[T, 3] a gaze that rests for so many frames at each of the places [N, 2] (rad), lids open."""
    gaze = np.repeat(np.asarray(places, np.float64), rests, axis=0)
    return np.column_stack([np.ones(len(gaze)), gaze])


def wandering(count, lengths, seed):
    rng = np.random.default_rng(seed)
    corners = np.radians([[-8.0, -4.0], [8.0, -4.0], [0.0, 6.0]])
    return eyes(rng.choice(lengths, count), corners[rng.permutation(np.arange(count) % 3)], seed)


def texture(*recordings, roles=None, patch=60):
    starts = np.cumsum([0, *map(len, recordings)])[:-1]
    known = np.full(len(recordings), EITHER) if roles is None else np.array(roles)
    return ShiftTexture(np.concatenate(recordings), starts, known, FPS, patch)


def rests_of(frames):
    shifts = gaze_shifts(frames[:, 1:], FPS)
    return np.diff([shift.start for shift in shifts])


def test_every_rest_lasts_as_long_as_one_that_was_recorded():
    lengths = [11, 17, 29, 43]
    recorded = [wandering(40, lengths, seed) for seed in range(3)]
    possible = set(np.concatenate([rests_of(one) for one in recorded]).tolist())
    grown = texture(*recorded).grow(6000, np.random.default_rng(1))
    assert len(grown.places) > 20
    assert set(rests_of(grown.frames).tolist()) <= possible
    assert set(lengths) <= set(rests_of(grown.frames).tolist())


def test_what_a_join_must_mend_fades_within_the_shift():
    rng = np.random.default_rng(4)
    recorded = [wandering(40, [20, 31], seed) for seed in range(3)]
    for one in recorded:
        one[:, 1:] += rng.normal(0, np.radians(0.2), (1, 2))
    grown = texture(*recorded).grow(4000, np.random.default_rng(2))
    assert grown.stuck == 0
    resting = np.hypot(*np.diff(grown.frames[:, 1:], axis=0).T) < 1e-9
    shifting = np.zeros(len(grown.frames) - 1, bool)
    for shift in gaze_shifts(grown.frames[:, 1:], FPS):
        shifting[shift.start : shift.stop + 1] = True
    assert (resting | shifting).all()


def test_nothing_that_fits_is_counted_and_the_nearest_is_taken():
    far = [eyes([20, 20, 20, 20], np.radians([[0, k], [20, k], [40 + k, k], [60, k]])) for k in (0, 8)]
    grown = texture(*far, patch=1).grow(400, np.random.default_rng(0))
    assert grown.stuck > 0
    assert np.isfinite(grown.frames).all()
    assert len(grown.frames) == 400
    assert np.radians(8) > NEAR_RAD


def test_who_listens_is_drawn_from_those_who_listened():
    speaks, listens = wandering(60, [15, 25], 1), wandering(60, [15, 25], 2)
    listens[:, 1] *= 0.5
    roles = np.repeat([SPEAKING, LISTENING, SPEAKING], 2000)
    grown = texture(speaks, listens, roles=[SPEAKING, LISTENING], patch=30).grow(6000, np.random.default_rng(3), roles)
    width = [np.abs(grown.frames[a : a + 1800, 1]).max() for a in (0, 2100, 4100)]
    assert np.degrees(width) == pytest.approx([8, 4, 8], abs=0.5)


def test_a_long_silence_is_listening_and_a_pause_is_not():
    phones = PhoneTrack(("pau", "aa", "pau", "iy", "pau"), np.array([0.5, 1.0, 1.5, 2.0, 5.0]))
    roles = roles_of(phones, 50, 10.0)
    assert (roles[:20] == SPEAKING).all()
    assert (roles[20:] == LISTENING).all()
    for unknown in (None, PhoneTrack(("pau",), np.array([5.0]))):
        assert (roles_of(unknown, 50, 10.0) == EITHER).all()


def test_the_same_seed_gives_the_same_eyes():
    own = texture(wandering(60, [15, 25], 1))
    one, same, other = (own.grow(2000, np.random.default_rng(seed)).frames for seed in (1, 1, 2))
    assert np.array_equal(one, same)
    assert not np.array_equal(one, other)
