"""Markers to weights from a few posed frames, against known answers."""

import numpy as np
import pytest
import torch
from scipy.ndimage import gaussian_filter1d

from facesynth.face.rig.arkit_rig import pose_points
from facesynth.face.rig.markers import marker_layout, marker_vertices
from facesynth.face.solve.blendshapes import MarkerBasis, solve_markers
from facesynth.face.solve.key_poses import KeyPoseMap, KeyPoses, worth_posing
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion

LAYOUT = Layout("markers", ("chin", "lip"), neutral=(0.0,) * 6)
MOVING = {"jawOpen": 0.25, "mouthPucker": 0.3, "mouthStretch": 0.15, "mouthSmile": 0.3, "browInnerUp": 0.3, "mouthUpperUp": 0.2}


def talk(rig, count=600, seed=0):
    """[T, 52] smooth weights of a few shapes, each at rest about half of the time."""
    rng, weights = np.random.default_rng(seed), np.zeros((count, 52))
    for name, size in MOVING.items():
        curve = gaussian_filter1d(rng.normal(size=count), 6)
        columns = [i for i, full in enumerate(rig.names) if full in (name, name + "Left", name + "Right")]
        weights[:, columns] = np.clip(size * curve / curve.std(), 0, 1)[:, None]
    return weights


def markers(rig, weights):
    return pose_points(rig, marker_vertices(rig, marker_layout(rig)), weights).reshape(len(weights), -1).astype(float)


def some_poses(count=4, seed=0):
    rng = np.random.default_rng(seed)
    return KeyPoses(LAYOUT, ("open", "wide"), rng.normal(size=(count, 6)), rng.uniform(0, 1, (count, 2)))


@pytest.fixture(scope="module")
def known(rig):
    """Recorded markers, and unseen weights with theirs."""
    recorded, unseen = talk(rig), talk(rig, 200, seed=1)
    return recorded, markers(rig, recorded), unseen, markers(rig, unseen)


def learned_from(rig, known, count):
    recorded, frames, _, wanted = known
    layout = marker_layout(rig)
    chosen = worth_posing(frames, layout.neutral, count)
    found = KeyPoseMap.fit(KeyPoses(layout, rig.names, frames[chosen], recorded[chosen]), layout.neutral, frames)
    weights = found(torch.from_numpy(wanted)).numpy()
    return weights, np.linalg.norm((markers(rig, weights) - wanted).reshape(len(wanted), -1, 3), axis=2).mean()


def test_weights_come_back_from_their_markers_and_more_poses_bring_them_nearer(rig, known):
    _, _, unseen, wanted = known
    still = np.linalg.norm((markers(rig, 0 * unseen) - wanted).reshape(len(wanted), -1, 3), axis=2).mean()
    exact = markers(rig, solve_markers(MarkerBasis.of(rig, marker_layout(rig)), wanted, 60.0)[0])
    least_squares = np.linalg.norm((exact - wanted).reshape(len(wanted), -1, 3), axis=2).mean()
    errors = {count: learned_from(rig, known, count)[1] for count in (5, 15, 40)}
    assert least_squares < errors[40] < errors[15] < errors[5] < still, (least_squares, errors, still)
    assert errors[15] < 0.25 * still
    weights, _ = learned_from(rig, known, 40)
    assert np.sqrt(np.square(weights - unseen).mean()) < 0.03
    assert weights[:, unseen.max(axis=0) == 0].max() < 1e-6, "shapes that nobody posed stay at rest"


def test_key_poses_are_met_and_rest_is_rest():
    poses = some_poses()
    found = KeyPoseMap.fit(poses, LAYOUT.neutral)
    np.testing.assert_allclose(found(torch.from_numpy(poses.frames)).numpy(), poses.weights, atol=0.06)
    np.testing.assert_allclose(found(torch.zeros(3, 6)).numpy(), 0, atol=0.06)
    assert found(torch.zeros(2, 5, 6, dtype=torch.float32)).shape == (2, 5, 2)
    assert found(torch.zeros(1, 6)).dtype == torch.float32


def test_weights_stay_within_what_was_posed_and_0_to_1():
    poses = some_poses()
    wide = KeyPoses(LAYOUT, poses.names, poses.frames, poses.weights * [1.0, -4.0])
    found = KeyPoseMap.fit(wide, LAYOUT.neutral)
    weights = found(torch.from_numpy(np.random.default_rng(2).normal(0, 20, (300, 6)))).numpy()
    assert (weights[:, 0] >= 0).all()
    assert (weights[:, 0] <= 1).all()
    assert weights[:, 1].min() == pytest.approx(wide.weights[:, 1].min())
    assert weights[:, 1].max() <= 1


def test_a_motion_becomes_an_animation_with_its_own_head_and_gaze():
    found = KeyPoseMap.fit(some_poses(), LAYOUT.neutral)
    frames = np.random.default_rng(3).normal(size=(8, 6))
    motion = Motion(frames, 25.0, LAYOUT, head=np.full((8, 6), 0.1), eyes=np.full((8, 3), 0.2))
    animation = found.animation(motion)
    assert animation.names == ("open", "wide")
    assert animation.fps == 25
    np.testing.assert_allclose(animation.head, 0.1, atol=1e-7)
    np.testing.assert_allclose(animation.gaze, 0.2, atol=1e-7)
    np.testing.assert_allclose(animation.weights, found(torch.from_numpy(motion.frames).double()).numpy(), atol=1e-6)
    with pytest.raises(FacesynthError, match="take both from one performer"):
        found.animation(Motion(frames[:, :3], 25.0, Layout("markers", ("nose",))))


def test_frames_worth_posing_are_far_from_rest_and_from_each_other():
    frames = np.zeros((6, 2))
    frames[[1, 3, 5]] = [[5, 0], [0, 4], [5, 0.1]]
    assert worth_posing(frames, [0, 0], 2).tolist() == [5, 3]
    with pytest.raises(FacesynthError, match="1 to 6"):
        worth_posing(frames, [0, 0], 7)


def test_wrong_key_poses_are_one_clear_line():
    good = some_poses()
    with pytest.raises(FacesynthError, match="at least 2 key poses"):
        KeyPoses(LAYOUT, good.names, good.frames[:1], good.weights[:1])
    with pytest.raises(FacesynthError, match=r"frames \[K, 6\] and weights \[K, 2\]"):
        KeyPoses(LAYOUT, good.names, good.frames[:, :5], good.weights)
    with pytest.raises(FacesynthError, match="got 4 frames and 3 rows"):
        KeyPoses(LAYOUT, good.names, good.frames, good.weights[:3])
    with pytest.raises(FacesynthError, match="key pose 2: its frames hold missing"):
        KeyPoses(LAYOUT, good.names, np.where(np.arange(4)[:, None] == 1, np.nan, good.frames), good.weights)
    twice = good.frames.copy()
    twice[3] = twice[1]
    with pytest.raises(FacesynthError, match="key poses 2 and 4 are the same pose"):
        KeyPoses(LAYOUT, good.names, twice, good.weights)
