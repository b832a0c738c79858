"""Lips meet at p, b and m where the points of another performer left them ajar, and never pass through each other."""

import numpy as np
import pytest

from facesynth.face.rig.markers import LipGap, marker_layout
from facesynth.face.solve.animate import animate
from facesynth.face.solve.closures import LARGEST_CLOSURE_MM, from_shut, with_lips_apart, with_lips_met
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.inference.speech import PhoneTrack
from facesynth.motion.arkit_names import ARKIT_NAMES

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


def test_what_most_closures_leave_open_is_shut_elsewhere_too_and_a_wide_mouth_stays_wide():
    opening_mm = np.linspace(-0.5, 15, 200)
    found = from_shut(opening_mm, [1.0, 1.2, 3.5])
    assert np.all(np.diff(found) >= 0), "a wider mouth stays wider"
    np.testing.assert_allclose(found[(opening_mm > 0) & (opening_mm <= 1.2)], 0, atol=1e-9)
    np.testing.assert_allclose(found[opening_mm > 10], opening_mm[opening_mm > 10], atol=0.1)
    for least in ([1.0], [], [0.0, 0.0], [-0.2, 0.0]):
        np.testing.assert_array_equal(from_shut(opening_mm, least), opening_mm)


def test_a_mouth_that_is_open_at_a_b_stays_so(lips):
    before = jaw(lips, LARGEST_CLOSURE_MM + 2)
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


def test_lips_that_cross_are_parted_and_others_left_alone(lips):
    """Random mouths, some with crossed lips: afterwards none, and those that did not cross untouched."""
    rng = np.random.default_rng(0)
    before = np.clip(rng.uniform(-1.0, 0.3, (300, 52)), 0, 1)
    before[:, ARKIT_NAMES.index("jawOpen")] = rng.uniform(0, 0.4, 300)
    before[:, ARKIT_NAMES.index("mouthClose")] = before[:, ARKIT_NAMES.index("jawOpen")] + rng.uniform(-0.3, 0.1, 300)
    before = np.clip(before, 0, 1)
    crossed = lips.gaps_mm(before).min(axis=1) < -0.01
    assert 30 < crossed.sum() < 270
    after = with_lips_apart(before, lips)
    assert lips.gaps_mm(after).min() > -0.01
    np.testing.assert_array_equal(
        after[~crossed & (lips.gaps_mm(before).min(axis=1) > 0)], before[~crossed & (lips.gaps_mm(before).min(axis=1) > 0)]
    )
    assert lips.opening_mm(after)[crossed].max() < 3.0
    assert (after.min(), after.max()) >= (0, 0)
    assert after.max() <= 1


def test_points_of_lips_pressed_together_shut_the_head_and_no_more(rig, lips):
    """A performer whose points lie 6 mm apart at rest (a moustache) and come 5 mm nearer where the lips press."""
    own = marker_layout(rig)
    neutral = np.asarray(own.neutral).reshape(-1, 3).copy()
    upper, lower = np.array(own.lip_pairs).T
    neutral[upper, 1] += 6.0
    layout = Layout(
        "markers", (*own.names[:-1], "extra"), dict(own.groups), own.lip_pairs, neutral=tuple(neutral.ravel().tolist())
    )
    wave = np.concatenate([np.linspace(0, -5, 20), np.linspace(-5, 15, 60)])
    points = np.tile(neutral, (80, 1, 1))
    points[:, lower, 1] -= wave[:, None]
    animation = animate(Motion(points.reshape(80, -1), FPS, layout), rig)
    gaps, opening = lips.gaps_mm(animation.weights), lips.opening_mm(animation.weights)
    assert gaps.min() > -0.01
    assert opening[wave < 0].max() < 0.6
    assert np.all(np.diff(opening[wave > 1]) > -1e-3), "a wider mouth is wider on the head"
    np.testing.assert_allclose(opening[wave > 1], wave[wave > 1], atol=2.0)
