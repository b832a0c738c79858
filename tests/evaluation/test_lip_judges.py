"""Judges that learn: lips in step with a sound, and lips that a classifier takes for recorded ones. Known answers."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest
import torch

from facesynth.evaluation.judge import Judge, Tally
from facesynth.evaluation.lip_shapes import LipShapes, windows
from facesynth.evaluation.pair import UnavailableError
from facesynth.evaluation.sync import MOST_SHIFT, NEVER_MOVES, SyncJudge, in_step
from facesynth.evaluation.two_sample import two_sample
from facesynth.inference.filters import gaussian
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.inference.speech import EmotionTrack, PhoneTrack, Speech

NAMES = ("upper", "lower", "left", "right", "brow")
LIPS = Layout("landmarks", NAMES, {"lips_inner": (0, 1), "lips_outer": (2, 3)}, lip_pairs=((0, 1),))
FPS, COUNT = 25.0, 75
RNG = np.random.default_rng(8)


@dataclass(frozen=True)
class Take:
    speech: Speech
    motion: Motion


class Takes(list):
    layout = LIPS


def take(fps=FPS):
    """Noise that is loud where the mouth is open, three seconds of it."""
    count = round(COUNT / FPS * fps)
    opening = np.maximum(gaussian(RNG.normal(size=count), 0.06 * fps) * 4, 0)
    sound = np.interp(np.arange(48000) / 16000, np.arange(count) / fps, opening) * RNG.standard_normal(48000)
    points = np.tile(np.array([[0.0, 1], [0, -1], [-2, 0], [2, 0], [0, 9]]), (count, 1, 1))
    points[:, 1, 1] -= opening
    points[:, :2] += 0.02 * RNG.standard_normal((count, 2, 2))
    speech = Speech(0.1 * sound.astype(np.float32), 16000, PhoneTrack(("aa",), [3.0]), EmotionTrack.constant("neutral", 3.0))
    return Take(speech, Motion(points.reshape(count, -1).astype(np.float32), fps, LIPS))


TAKES, OTHERS = Takes(take() for _ in range(14)), [take() for _ in range(8)]


def moved(motion, frames):
    """The same motion so many frames later, its ends held."""
    at = np.clip(np.arange(len(motion)) - frames, 0, len(motion) - 1)
    return replace(motion, frames=motion.frames[at])


@pytest.fixture(scope="module")
def judge():
    return SyncJudge.learn(TAKES)


@pytest.mark.parametrize("frames", [0, 2, -3])
def test_recordings_are_in_step_and_what_was_moved_is_as_late_as_it_was_moved(judge, frames):
    found = [judge.shift_ms(one.speech, moved(one.motion, frames)) for one in OTHERS]
    assert np.median(found) == frames * 40
    assert np.mean(np.array(found) == frames * 40) >= 0.75


def test_lips_of_another_sentence_are_in_step_no_more_often_than_by_chance(judge):
    pairs = list(pairwise(OTHERS)) + list(pairwise(OTHERS[::2]))
    found = [judge.shift_ms(one.speech, other.motion) for one, other in pairs]
    assert np.mean(np.array(found) == 0) <= 0.4


def smaller(motion, share):
    """The same movement about its mean, so much smaller."""
    middle = motion.frames.mean(axis=0)
    return replace(motion, frames=middle + np.float32(share) * (motion.frames - middle))


def test_it_matters_when_lips_move_and_not_how_much(judge):
    wrong = [judge.shift_ms(one.speech, smaller(other.motion, 0.15)) for one in OTHERS for other in OTHERS if one is not other]
    right = [judge.shift_ms(one.speech, smaller(one.motion, 0.15)) for one in OTHERS]
    assert in_step(wrong).mean() <= 0.25
    assert in_step(right).mean() >= 0.75


def test_lips_that_never_move_go_with_no_sound(judge):
    for one, share in zip(OTHERS[:3], (0.0, 0.01, 0.05), strict=True):
        assert np.isnan(judge.shift_ms(one.speech, smaller(one.motion, share)))
    assert np.isnan(in_step([np.nan, None, np.nan])).all(), "nothing is said of a face that rests"
    np.testing.assert_array_equal(in_step([0.0, 40.0, np.nan, None]), [1, 0, 0, np.nan])


def test_motion_of_another_rate_is_judged_the_same(judge):
    fast = take(fps=60.0)
    assert abs(judge.shift_ms(fast.speech, fast.motion)) <= 40
    assert judge.shift_ms(fast.speech, moved(fast.motion, 12)) == pytest.approx(200, abs=41)


def test_the_judge_repeats_and_leaves_torchs_generator_alone(judge):
    before = torch.random.get_rng_state()
    again = SyncJudge.learn(TAKES)
    assert torch.equal(before, torch.random.get_rng_state())
    assert torch.equal(again.sound[0].weight, judge.sound[0].weight)


def test_what_cannot_be_judged_says_why(judge):
    short = replace(OTHERS[0].motion, frames=OTHERS[0].motion.frames[: 2 * MOST_SHIFT])
    with pytest.raises(UnavailableError, match="too short"):
        judge.shift_ms(OTHERS[0].speech, short)
    with pytest.raises(UnavailableError, match="too short"):
        SyncJudge.learn(Takes(TAKES[:1]))
    with pytest.raises(UnavailableError, match="4 utterances"):
        two_sample(judge.shapes, {"a": TAKES[0].motion}, {"a": TAKES[0].motion})


def by_name(motions):
    return {f"u{k}": motion for k, motion in enumerate(motions)}


def test_motion_like_the_recorded_cannot_be_told_and_a_still_or_a_smooth_face_can(judge):
    recorded = by_name(one.motion for one in TAKES)
    alike = by_name(take().motion for _ in TAKES)
    still = by_name(replace(m, frames=np.tile(m.frames.mean(axis=0), (len(m), 1))) for m in recorded.values())
    smooth = by_name(replace(m, frames=gaussian(m.frames.astype(np.float64), 4.0).astype(np.float32)) for m in recorded.values())
    told = {name: np.mean(list(two_sample(judge.shapes, made, recorded).values())) for name, made in
            (("alike", alike), ("still", still), ("smooth", smooth))}  # fmt: skip
    assert told["alike"] < 0.62
    assert told["still"] > 0.95
    assert told["smooth"] > 0.8


def test_shapes_do_not_depend_on_where_the_face_is_and_gaps_stay_gaps():
    shapes, motion = LipShapes.learn(TAKES), TAKES[0].motion
    moved_away = replace(motion, frames=motion.frames + np.tile(np.float32([30, -7]), len(NAMES)))
    np.testing.assert_allclose(shapes.of(moved_away), shapes.of(motion), atol=1e-3)
    holed = motion.frames.copy()
    holed[10, 0] = np.nan
    assert np.isnan(shapes.of(replace(motion, frames=holed))[10]).all()


def test_windows_are_all_stretches():
    signal = np.arange(10.0).reshape(5, 2)
    assert np.array_equal(windows(signal, 3), [signal[0:3], signal[1:4], signal[2:5]])
    assert windows(signal, 6).shape == (0, 6, 2)


@dataclass(frozen=True)
class Said(Take):
    id: str
    emotion: str = "neutral"


def row(judge, motions):
    """What a table shows of motions for the sounds of OTHERS."""
    figures = Tally()
    for one, motion in zip(OTHERS, motions, strict=False):
        figures.add(Judge(float("nan"), None, judge), Said(one.speech, one.motion, "one"), motion)
    return figures.row("some", {})


def test_a_table_tells_how_often_lips_are_in_step_and_nothing_of_a_face_that_rests(judge):
    still = [smaller(one.motion, 0.0) for one in OTHERS[:2]]
    moving = row(judge, (OTHERS[0].motion, moved(OTHERS[1].motion, 4), smaller(OTHERS[2].motion, 0.0)))
    assert moving.values["sync_offset"] == pytest.approx((0, 160, np.nan), abs=41, nan_ok=True)
    assert moving.values["sync_rate"][1:] == (0, 0), "whoever stands still now and then gains nothing by it"
    resting = row(judge, still)
    assert "sync_rate" not in resting.values
    assert resting.reasons["sync_rate"] == resting.reasons["sync_offset"] == NEVER_MOVES
