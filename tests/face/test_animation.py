"""Motion put on the head: weights, blinks, gaze, head and tongue."""

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from facesynth.face.animation import FaceAnimation
from facesynth.face.behaviour.eyes import quiet_blinks, quiet_gaze
from facesynth.face.rig.arkit import gaze_of, gaze_weights
from facesynth.face.solve.animate import animate
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.inference.speech import PhoneTrack
from facesynth.motion.arkit_names import ARKIT_NAMES


def still(rig, count=240, fps=60.0, **extra):
    from facesynth.face.rig.markers import marker_layout

    layout = marker_layout(rig)
    return Motion(np.tile(layout.neutral, (count, 1)), fps, layout, **extra)


def some_animation(count=120, fps=120.0):
    phase = np.arange(count) / fps
    weights = np.clip(np.sin(phase[:, None] * np.linspace(3, 30, 52)), 0, 1)
    head = np.stack([0.3 * np.sin(phase * k) for k in range(1, 7)], axis=1)
    return FaceAnimation(ARKIT_NAMES, weights, head, 0.1 * head[:, :2], weights[:, 17], fps)


def test_a_resting_face_gives_no_weights_but_blinks(rig):
    animation = animate(still(rig, 1200), rig)
    moving = {name for name, column in zip(animation.names, animation.weights.T, strict=True) if column.max() > 1e-6}
    assert {name.removesuffix("Left").removesuffix("Right")[:7] for name in moving} == {"eyeBlin", "eyeLook"}
    assert animation.weight("eyeBlinkLeft").max() > 0.95
    assert (animation.head == 0).all()


def test_eyes_off_are_open_and_straight(rig):
    animation = animate(still(rig), rig, eyes_gain=0)
    assert (animation.weights == 0).all()
    assert (animation.gaze == 0).all()


def test_own_eyes_are_used_and_scaled(rig):
    eyes = np.tile([0.25, 0.2, -0.1], (240, 1))
    animation = animate(still(rig, eyes=eyes), rig, eyes_gain=0.5)
    np.testing.assert_allclose(animation.gaze, np.tile([0.1, -0.05], (240, 1)), atol=1e-6)
    assert animation.weight("eyeBlinkLeft").min() >= 0.75 - 1e-6
    assert animation.weight("eyeLookOutLeft")[0] == pytest.approx(0.1 / np.radians(24))
    assert animation.weight("eyeLookInLeft")[0] == 0


def test_the_head_moves_markers_as_the_motion_says(rig):
    """A pose about the rigid markers and one about the rig's pivot are the same movement of the points."""
    from facesynth.face.rig.arkit_rig import pose_points
    from facesynth.face.rig.markers import marker_vertices
    from facesynth.motion.pose import apply_head, rigid_points

    head = np.random.default_rng(0).normal(0, [0.2] * 3 + [5.0] * 3, (40, 6)).astype(np.float32)
    motion = still(rig, 40, head=head)
    neutral = np.array(motion.layout.neutral).reshape(-1, 3)
    wanted = apply_head(motion.points, head, neutral, rigid_points(motion.layout))
    animation = animate(motion, rig)
    vertices = marker_vertices(rig, motion.layout)
    got = pose_points(rig, vertices, np.zeros((40, 52)), animation.head)
    whole = rig.head_weight[vertices] > 0.999
    assert whole.sum() > 40
    np.testing.assert_allclose(got[:, whole], wanted[:, whole], atol=2e-3)


def test_head_gain_scales_and_switches_off(rig):
    head = np.tile(np.float32([0, 0.2, 0, 0, 0, 0]), (30, 1))
    motion = still(rig, 30, head=head)
    assert (animate(motion, rig, head_gain=0).head == 0).all()
    np.testing.assert_allclose(animate(motion, rig, head_gain=2).head[:, 1], 0.4, atol=1e-6)


def test_arkit_curves_pass_through(rig):
    layout = Layout("curves", ("jawOpen", "MouthSmileLeft", "eyeLookOutLeft", "eyeLookInRight", "sneeze"))
    frames = np.tile(np.float32([0.5, 1.2, 0.5, 0.5, 0.3]), (60, 1))
    animation = animate(Motion(frames, 30.0, layout), rig)
    np.testing.assert_allclose(animation.weight("jawOpen"), 0.5)
    np.testing.assert_allclose(animation.weight("mouthSmileLeft"), 1.0)
    np.testing.assert_allclose(animation.gaze[:, 0], np.radians(12), atol=1e-6)


def test_tongue_follows_the_phones(rig):
    phones = PhoneTrack(("pau", "t", "aa", "th"), np.array([1.0, 1.5, 2.5, 4.0]))
    layout = Layout("curves", ("jawOpen",))
    frames = np.full((240, 1), 0.3, np.float32)
    animation = animate(Motion(frames, 60.0, layout), rig, phones=phones)
    middle = {
        label: round((start + end) * 30) for label, start, end in zip(phones.labels, phones.starts_s, phones.ends_s, strict=True)
    }
    assert animation.tongue_up[middle["t"]] > 0.95
    assert animation.tongue_up[middle["aa"]] < 0.05
    assert animation.weight("tongueOut")[middle["th"]] > 0.3
    shut = animate(Motion(frames * 0, 60.0, layout), rig, phones=phones)
    assert shut.weight("tongueOut").max() < 0.05


def test_the_same_seed_gives_the_same_face(rig):
    one, same, other = (animate(still(rig), rig, seed=seed) for seed in (3, 3, 4))
    np.testing.assert_array_equal(one.weights, same.weights)
    assert np.abs(one.gaze - other.gaze).max() > 1e-3


@pytest.mark.parametrize("name", ["frames", "head", "eyes"])
def test_missing_samples_are_refused(rig, name):
    arrays = {"frames": np.array(still(rig, 20).frames), "head": np.zeros((20, 6)), "eyes": np.ones((20, 3))}
    arrays[name][3, 1] = np.nan
    layout = still(rig, 1).layout
    with pytest.raises(FacesynthError, match="fill the gaps"):
        animate(Motion(arrays["frames"], 60.0, layout, arrays["head"], arrays["eyes"]), rig)


def test_wrong_motions_and_gains_are_refused(rig):
    with pytest.raises(FacesynthError, match="without frames"):
        animate(still(rig, 0), rig)
    with pytest.raises(FacesynthError, match="head_gain"):
        animate(still(rig, 5), rig, head_gain=float("nan"))
    with pytest.raises(FacesynthError, match="2-D points are placed"):
        animate(Motion(np.zeros((5, 2)), 60.0, Layout("landmarks", ("chin",))), rig)


@pytest.mark.parametrize("fps", [24000 / 1001, 30000 / 1001, 25.0, 60.0, 300.0])
def test_resampling_keeps_time_range_and_turns(fps):
    animation = some_animation()
    other = animation.resampled(fps)
    assert len(other) == round(animation.duration_s * fps)
    assert other.fps == fps
    assert other.weights.min() >= 0
    assert other.weights.max() <= 1
    inside = other.times_s <= animation.times_s[-1]
    np.testing.assert_allclose(other.head[inside, 1], 0.3 * np.sin(other.times_s[inside] * 2), atol=0.01)
    assert animation.resampled(120.0) is animation


@pytest.mark.parametrize("count", [2, 3, 1023, 1024, 1025, 1026, 2600])
@pytest.mark.parametrize("fps", [1.0, 29.97, 240.0])
def test_a_long_animation_read_in_pieces_is_what_the_whole_gives_bit_for_bit(count, fps):
    animation = some_animation(count)
    other = animation.resampled(fps)
    at = np.minimum(other.times_s, animation.times_s[-1])
    whole = np.clip(PchipInterpolator(animation.times_s, animation.weights, axis=0)(at), 0, 1)
    np.testing.assert_array_equal(other.weights, whole.astype(np.float32))


def test_one_frame_and_no_frame():
    one = some_animation(1)
    assert len(one.resampled(240.0)) == 2
    with pytest.raises(FacesynthError, match="at least one frame"):
        some_animation(0)


def test_animations_are_checked():
    good = some_animation(4)
    with pytest.raises(FacesynthError, match="head of an animation must have shape"):
        FaceAnimation(good.names, good.weights, good.head[:, :3], good.gaze, good.tongue_up, 30.0)
    with pytest.raises(FacesynthError, match=r"0\.\.1"):
        FaceAnimation(good.names, good.weights + 1, good.head, good.gaze, good.tongue_up, 30.0)
    with pytest.raises(FacesynthError, match="NaN"):
        FaceAnimation(good.names, good.weights, good.head * np.nan, good.gaze, good.tongue_up, 30.0)


def test_gaze_and_look_weights_are_inverse():
    gaze = np.random.default_rng(1).uniform(-0.2, 0.2, (50, 2))
    np.testing.assert_allclose(gaze_of(gaze_weights(np.zeros((50, 52)), gaze)), gaze, atol=1e-7)


def test_blinks_come_as_often_as_people_blink():
    blinks = quiet_blinks(120 * 600, 120.0, seed=0)
    starts = np.count_nonzero((blinks[1:] > 0.5) & (blinks[:-1] <= 0.5))
    assert 12 <= starts / 10 <= 24  # a minute
    assert 0.01 < (blinks > 0.5).mean() < 0.08
    assert blinks.max() == pytest.approx(1, abs=1e-6)


def test_gaze_is_small_and_rests():
    gaze = quiet_gaze(120 * 120, 120.0, seed=0)
    assert np.degrees(np.abs(gaze)).max() < 12
    assert (np.abs(np.diff(gaze, axis=0)).max(axis=1) < 1e-9).mean() > 0.9
    np.testing.assert_allclose(quiet_gaze(600, 30.0, seed=5)[::1], quiet_gaze(2400, 120.0, seed=5)[::4], atol=1e-9)


def test_curves_none_of_which_is_arkits_keep_their_names(rig):
    values = np.linspace(-0.5, 1.5, 5)[:, None]
    animation = animate(Motion(values, 60.0, Layout("curves", ("smirk",))), rig)
    assert animation.names == ("smirk",)
    np.testing.assert_allclose(animation.weights, np.clip(values, 0, 1), atol=1e-6)
