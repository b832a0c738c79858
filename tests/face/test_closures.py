"""Lips meet at p, b and m where the points of another performer left them ajar."""

import numpy as np
import pytest

from facesynth.face.animation import animate
from facesynth.face.closures import MOST_MM, with_lips_met
from facesynth.face.markers import LipGap, marker_layout
from facesynth.face.rig import ARKIT_NAMES
from facesynth.motion.layout import Layout
from facesynth.motion.motion import Motion
from facesynth.speech.speech import PhoneTrack

FPS = 50.0
PHONES = PhoneTrack(("aa", "b", "aa", "s", "aa"), np.array([0.4, 0.5, 0.9, 1.0, 1.4]))
IN_B, IN_S = slice(20, 25), slice(45, 50)


@pytest.fixture
def lips(rig):
    return LipGap.of(rig)


def jaw(lips, least_mm):
    """70 frames [70, 52] of a jaw that opens the lips by 10 mm, narrowing to `least_mm` in the b and in the s."""
    wanted = np.full(70, 10.0)
    for centre in (22, 47):
        wanted -= (10 - least_mm) * np.exp(-0.5 * ((np.arange(70) - centre) / 3.0) ** 2)
    column = ARKIT_NAMES.index("jawOpen")
    weights = np.zeros((70, 52))
    weights[:, column] = (wanted - lips.opening_mm(np.zeros((1, 52)))) / lips.opening_mm(np.eye(52)[[column]])
    assert lips.opening_mm(weights).max() > 5
    return weights


def test_the_b_is_shut_at_its_narrowest_and_nothing_else(lips):
    before = jaw(lips, 1.5)
    after = with_lips_met(before, lips, PHONES, FPS)
    opening = lips.opening_mm(before), lips.opening_mm(after)
    moment = 20 + opening[0][IN_B].argmin()
    assert opening[1][moment] == pytest.approx(0, abs=1e-6)
    assert opening[1].argmin() == moment
    np.testing.assert_array_equal(after[IN_S], before[IN_S])
    np.testing.assert_array_equal(
        np.delete(after, ARKIT_NAMES.index("mouthClose"), axis=1), np.delete(before, ARKIT_NAMES.index("mouthClose"), axis=1)
    )
    assert (opening[0] - opening[1]).max() == pytest.approx(opening[0][moment], rel=1e-6), (
        "never narrowed by more than was missing"
    )


def test_a_mouth_that_is_open_at_a_b_stays_so(lips):
    before = jaw(lips, MOST_MM + 2)
    np.testing.assert_array_equal(with_lips_met(before, lips, PHONES, FPS), before)


def test_phones_beyond_the_motion_are_passed_over(lips):
    before = jaw(lips, 1.5)[:10]
    np.testing.assert_array_equal(with_lips_met(before, lips, PHONES, FPS), before)


def test_only_points_of_another_performer_are_corrected(rig, lips):
    own = marker_layout(rig)
    foreign = Layout(
        "markers", tuple(f"p{i}" for i in range(len(own.names))), dict(own.groups), own.lip_pairs, neutral=own.neutral
    )
    points = np.tile(np.asarray(own.neutral), (70, 1)).reshape(70, -1, 3)
    points[:, [b for _, b in own.lip_pairs], 1] -= 2.0
    frames = points.reshape(70, -1)
    for layout, closes in ((own, False), (foreign, True)):
        motion = Motion(frames, FPS, layout)
        without, told = (lips.opening_mm(animate(motion, rig, phones=phones).weights) for phones in (None, PHONES))
        assert without[IN_B].min() > 0.5
        assert (told[IN_B].min() < 0.05) == closes
