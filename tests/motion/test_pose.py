import numpy as np
import pytest
from corpora import tiny_layout
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.motion.pose import apply_head, fill_head, remove_head, rigid_points

LAYOUT = tiny_layout()
NEUTRAL = np.reshape(LAYOUT.neutral, (-1, 3))
RIGID = rigid_points(LAYOUT)
ANGLES = st.tuples(*[st.floats(-2.5, 2.5)] * 3).filter(lambda v: np.linalg.norm(v) < 3.1)
SHIFTS = st.tuples(*[st.floats(-500, 500)] * 3)


def talking(frames: int, seed: int = 0) -> np.ndarray:
    """Points that move with expression, the rigid ones not."""
    points = NEUTRAL + np.random.default_rng(seed).normal(0, 4, (frames, *NEUTRAL.shape))
    points[:, RIGID] = NEUTRAL[RIGID]
    return points


@settings(max_examples=60, deadline=None)
@given(ANGLES, SHIFTS)
def test_applying_and_removing_a_pose_is_the_identity(angles, shift):
    points = talking(3)
    head = np.tile([*angles, *shift], (3, 1))
    stabilised, found = remove_head(apply_head(points, head, NEUTRAL, RIGID), NEUTRAL, RIGID)
    np.testing.assert_allclose(stabilised, points, atol=2e-3)
    turn = Rotation.from_rotvec(found[:, :3]) * Rotation.from_rotvec(head[:, :3]).inv()
    assert turn.magnitude().max() < 1e-4
    np.testing.assert_allclose(found[:, 3:], head[:, 3:], atol=2e-3)


def test_the_rotation_acts_on_column_vectors():
    quarter = Rotation.from_rotvec([0, np.pi / 2, 0])
    centre = NEUTRAL[RIGID].mean(axis=0)
    world = quarter.apply(NEUTRAL - centre) + centre + [1, 2, 3]
    _, head = remove_head(world[None], NEUTRAL, RIGID)
    np.testing.assert_allclose(head[0], [0, np.pi / 2, 0, 1, 2, 3], atol=1e-4)


def test_mirrored_points_are_never_answered_with_a_reflection():
    flat = NEUTRAL * [1, 1, 0]
    rng = np.random.default_rng(1)
    for _ in range(20):
        head = np.concatenate([rng.normal(0, 0.5, 3), rng.normal(0, 10, 3)])[None]
        stabilised, _ = remove_head(apply_head(flat[None], head, flat, RIGID), flat, RIGID)
        np.testing.assert_allclose(stabilised[0], flat, atol=1e-3)


def test_noise_on_expression_does_not_leak_into_the_pose():
    _, head = remove_head(talking(20), NEUTRAL, RIGID)
    np.testing.assert_allclose(head, 0, atol=1e-5)


def test_a_missing_rigid_point_does_not_move_the_pose():
    rigid = np.array([0, 1, 2, 5, 13])
    head = np.tile([0.1, -0.2, 0.3, 5, -6, 7], (4, 1))
    world = apply_head(np.tile(NEUTRAL, (4, 1, 1)), head, NEUTRAL, rigid)
    for frame, point in enumerate(rigid[:4]):
        world[frame, point] = np.nan
    stabilised, found = remove_head(world, NEUTRAL, rigid)
    np.testing.assert_allclose(found, head, atol=1e-3)
    assert np.isnan(stabilised[0, 0]).all()
    np.testing.assert_allclose(stabilised[0, 1:], NEUTRAL[1:], atol=2e-3)


def test_too_few_points_give_no_pose_and_short_gaps_are_filled():
    frames = 60
    swing = np.column_stack([np.zeros(frames), np.linspace(0, 0.5, frames), np.zeros(frames), *[np.linspace(0, 9, frames)] * 3])
    world = apply_head(talking(frames), swing, NEUTRAL, RIGID)
    world[20:26, RIGID[:1]] = np.nan
    stabilised, head = remove_head(world, NEUTRAL, RIGID)
    assert np.isnan(head[20:26]).all()
    assert np.isnan(stabilised[20:26]).all()
    assert not np.isnan(np.delete(head, range(20, 26), axis=0)).any()
    np.testing.assert_allclose(fill_head(head, 120), swing, atol=1e-3)
    assert np.isnan(fill_head(head, 30)[20:26]).all(), "six frames are too long at 30 fps"


def test_points_on_a_line_cannot_tell_a_pose():
    with pytest.raises(FacesynthError, match="not on one line"):
        remove_head(NEUTRAL[None], NEUTRAL, [5, 6])
    line = np.column_stack([np.arange(14.0), np.zeros(14), np.zeros(14)])
    with pytest.raises(FacesynthError, match="not on one line"):
        remove_head(line[None], line, np.arange(14))


def test_a_layout_without_rigid_points_uses_all():
    np.testing.assert_array_equal(rigid_points(Layout("markers", ("a", "b"))), [0, 1])


def test_wrong_shapes_are_refused():
    with pytest.raises(FacesynthError, match="shape"):
        remove_head(NEUTRAL, NEUTRAL, RIGID)
