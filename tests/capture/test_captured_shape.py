import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from seen_faces import face_mm, seen, talking

from facesynth.capture.landmarks import GROUPS, LIP_PAIRS, NAMES, RIGID, landmark_layout
from facesynth.capture.motion import motion_of
from facesynth.capture.shape import neutral_shape
from facesynth.capture.track import Track
from facesynth.inference.errors import FacesynthError
from facesynth.inference.lips import lip_gap


def nodding(count=60):
    slow = np.sin(2 * np.pi * np.arange(count) / count)
    turns = Rotation.from_rotvec(np.stack([0.2 * slow, -0.15 * slow, 0.1 * slow], axis=1))
    return turns, np.stack([8 * slow, -5 * slow, 0 * slow], axis=1)


def distances(points):
    return np.linalg.norm(points[:, None] - points[None], axis=2)


def test_the_rest_pose_is_found_whatever_the_head_does_and_however_far_the_camera_is():
    turns, shifts = nodding()
    tracks = [seen(talking(), turns, shifts), seen(talking(), zoom=np.full(60, 1.6))]
    neutral = neutral_shape(tracks)
    assert np.linalg.norm(neutral[263] - neutral[33]) == pytest.approx(90)
    assert np.abs(distances(neutral) - distances(face_mm())).max() < 1.0, "the same shape, up to turn and shift"
    upper, lower = LIP_PAIRS[1]
    assert 0 <= neutral[upper, 1] - neutral[lower, 1] < 0.8, "the mouth is shut"


def test_movement_comes_out_in_mm_and_the_head_apart():
    turns, shifts = nodding()
    neutral = neutral_shape([seen(talking())])
    motion = motion_of(seen(talking(), turns, shifts, zoom=np.full(60, 0.8)), landmark_layout(neutral))
    assert motion.frames.shape == (60, 468 * 3)
    still = motion_of(seen(talking()), landmark_layout(neutral))
    assert np.abs(motion.frames - still.frames).max() < 0.5
    assert lip_gap(motion).max() == pytest.approx(12.5, abs=0.7)
    assert lip_gap(motion).min() < 1
    assert np.degrees(np.abs(motion.head[:, :3] - turns.as_rotvec()).max()) < 0.5
    middle = face_mm()[list(RIGID)].mean(axis=0)
    moved = turns.apply(middle) + shifts
    assert np.abs(motion.head[:, 3:5] - (moved - np.median(moved, axis=0))[:, :2]).max() < 0.3


def test_frames_without_a_face_are_gaps_in_everything():
    track = seen(talking())
    points, irises = track.points_px.copy(), track.irises_px.copy()
    points[10:14], irises[10:14] = np.nan, np.nan
    motion = motion_of(Track(points, irises, 25.0), landmark_layout(neutral_shape([track])))
    gone = np.isin(np.arange(60), range(10, 14))
    for signal in (motion.frames, motion.head, motion.eyes):
        assert np.array_equal(np.isnan(signal).all(axis=1), gone)
        assert np.array_equal(np.isnan(signal).any(axis=1), gone)


def test_blinks_and_gaze():
    shapes = np.tile(face_mm(), (50, 1, 1))
    shut = np.isin(np.arange(50), range(20, 24))
    for lid in (160, 158, 387, 385):
        shapes[shut, lid, 1] = -1.0
    look = np.r_[np.zeros(30), np.full(20, 3.0)]
    middles = np.array([[-30.5, 0, -6], [30.5, 0, -6]])
    irises = np.tile(middles, (50, 1, 1)) + look[:, None, None] * [1.0, 0.5, 0]
    eyes = motion_of(seen(shapes, irises_mm=irises), landmark_layout(neutral_shape([seen(shapes)]))).eyes
    assert eyes[shut, 0].max() < 0.1
    assert eyes[~shut, 0].min() > 0.95
    turned = eyes[40, 1:] - eyes[5, 1:]
    assert np.allclose(turned, [np.arcsin(3 / 12), np.arcsin(1.5 / 12)], atol=0.01), "left and up are positive"


def test_the_layout_names_every_region_once_on_each_side():
    layout = landmark_layout(face_mm())
    assert layout.names == NAMES
    assert layout.channels == 1404
    wanted = {"mouth", "lips_inner", "lips_outer", "upper_lip", "lower_lip", "jaw", "brows", "eyelids", "cheeks", "rigid"}
    assert wanted | {"upper_face"} <= set(layout.groups)
    for name, points in GROUPS.items():
        assert len(set(points)) == len(points), name
    assert not set(GROUPS["upper_lip"]) & set(GROUPS["lower_lip"])
    assert not set(RIGID) & set(GROUPS["mouth"] + GROUPS["jaw"] + GROUPS["brows"])


def test_another_layout_and_no_face_at_all_are_refused():
    from corpora import tiny_layout

    with pytest.raises(FacesynthError, match="another layout"):
        motion_of(seen(talking()), tiny_layout())
    nothing = Track(np.full((9, 468, 3), np.nan, np.float32), np.full((9, 2, 2), np.nan, np.float32), 25.0)
    with pytest.raises(FacesynthError, match="no clip shows a face"):
        neutral_shape([nothing])
