import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from facesynth.face.rig.anny import build_head, head_folder
from facesynth.face.rig.arkit import gaze_weights
from facesynth.face.rig.arkit_rig import PIVOT_MM, load_head, pose, pose_points
from facesynth.inference.errors import FacesynthError
from facesynth.motion.arkit_names import ARKIT_NAMES


def weights(**values):
    w = np.zeros(52)
    for name, value in values.items():
        w[ARKIT_NAMES.index(name)] = value
    return w


def test_there_are_52_different_names_in_live_link_order():
    assert len(set(ARKIT_NAMES)) == 52
    assert ARKIT_NAMES[:2] == ("eyeBlinkLeft", "eyeLookDownLeft")
    assert ARKIT_NAMES[14:19] == ("jawForward", "jawRight", "jawLeft", "jawOpen", "mouthClose")
    assert ARKIT_NAMES[-1] == "tongueOut"


def test_arrays_fit_together(rig):
    count = len(rig.rest_mm)
    assert (count, len(rig.quads)) == (6202, 6030)
    assert rig.shapes_mm.shape == (52, count, 3)
    assert rig.quads.min() == 0
    assert rig.quads.max() == count - 1
    assert ((rig.head_weight >= 0) & (rig.head_weight <= 1)).all()
    assert (np.diff(rig.source_index) > 0).all()
    assert (rig.part[rig.quads] == rig.quad_part[:, None]).all()


def test_the_right_half_mirrors_the_left(rig):
    distance, mirror = cKDTree(rig.rest_mm).query(rig.rest_mm * [-1, 1, 1])
    assert distance.max() < 1e-3
    for i, name in enumerate(ARKIT_NAMES):
        other = name.replace("Left", "@").replace("Right", "Left").replace("@", "Right")
        np.testing.assert_allclose(rig.shapes_mm[i], rig.shapes_mm[ARKIT_NAMES.index(other)][mirror] * [-1, 1, 1], atol=1e-4)


def test_left_shapes_move_the_performers_left_side(rig):
    for name in ("eyeBlinkLeft", "mouthSmileLeft", "browDownLeft"):
        moved = np.linalg.norm(rig.shapes_mm[ARKIT_NAMES.index(name)], axis=1)
        assert rig.rest_mm[moved.argmax(), 0] > 10


def test_no_weights_is_the_rest_pose(rig):
    np.testing.assert_array_equal(pose(rig, np.zeros(52)), rig.rest_mm)
    np.testing.assert_allclose(pose(rig, np.zeros(52), np.zeros(6), [0, 0]), rig.rest_mm, atol=1e-4)


def test_the_face_follows_the_head_rigidly_and_the_shoulders_stay(rig):
    head = np.array([0.1, -0.2, 0.05, 3.0, -2.0, 1.0])
    posed = pose(rig, np.zeros(52), head)
    face, torso = rig.head_weight == 1, rig.head_weight == 0
    expected = Rotation.from_rotvec(head[:3]).apply(rig.rest_mm[face] - PIVOT_MM) + PIVOT_MM + head[3:]
    np.testing.assert_allclose(posed[face], expected, atol=1e-3)
    np.testing.assert_array_equal(posed[torso], rig.rest_mm[torso])
    assert torso.sum() > 100


def test_tracks_equal_poses(rig):
    rng = np.random.default_rng(1)
    values, head = rng.random((3, 52)), rng.normal(0, 0.1, (3, 6))
    index = rng.choice(rig.vertices_of("skin"), 90, replace=False)
    tracks = pose_points(rig, index, values, head)
    for t in range(3):
        np.testing.assert_allclose(tracks[t], pose(rig, values[t], head[t])[index], atol=1e-3)


def test_eyes_turn_rigidly_about_their_centre(rig):
    gaze = np.array([0.3, 0.1])
    posed = pose(rig, np.zeros(52), gaze=gaze)
    for side in ("left", "right"):
        ball, centre = rig.vertices_of(f"{side}_eye"), rig.eye_centre_mm(side)
        before, after = rig.rest_mm[ball] - centre, posed[ball] - centre
        np.testing.assert_allclose(np.linalg.norm(before, axis=1), np.linalg.norm(after, axis=1), atol=1e-3)
        axis = Rotation.align_vectors(after, before)[0].apply([0, 0, 1])
        assert np.arctan2(axis[0], axis[2]) == pytest.approx(gaze[0], abs=0.01)
        assert np.arcsin(axis[1]) == pytest.approx(gaze[1], abs=0.01)


def test_looking_left_turns_the_left_eye_outwards():
    values = gaze_weights(np.zeros((2, 52)), [[0.2, 0.0], [0.0, -0.1]])
    assert values[0, ARKIT_NAMES.index("eyeLookOutLeft")] == values[0, ARKIT_NAMES.index("eyeLookInRight")] > 0.4
    assert values[0, ARKIT_NAMES.index("eyeLookOutRight")] == values[0, ARKIT_NAMES.index("eyeLookInLeft")] == 0
    assert values[1, ARKIT_NAMES.index("eyeLookDownLeft")] > 0.2


def test_lids_meet_from_blink_0_8(rig):
    upper, lower = rig.from_source([13352, 13370])  # edges of the left lids above and below the pupil
    opening = [np.subtract(*pose(rig, weights(eyeBlinkLeft=blink))[[upper, lower], 1]) for blink in (0, 0.5, 0.8)]
    assert opening[0] > 6
    assert opening[1] > 0
    assert opening[2] <= 0


def test_lifting_the_tongue_moves_nothing_else(rig):
    moved = np.abs(pose(rig, np.zeros(52), tongue_up=1.0) - rig.rest_mm).max(axis=1) > 0
    assert set(np.nonzero(moved)[0]) <= set(rig.vertices_of("tongue"))
    assert (pose(rig, np.zeros(52), tongue_up=1.0) - rig.rest_mm)[:, 1].max() == pytest.approx(4.5, abs=0.1)


@pytest.mark.parametrize("bad", [np.zeros(51), np.zeros((2, 3, 52)), np.full(52, np.nan)])
def test_bad_weights_are_refused(rig, bad):
    with pytest.raises(FacesynthError):
        pose(rig, bad)


def test_a_head_pose_of_another_length_is_refused(rig):
    with pytest.raises(FacesynthError, match=r"\[3, 6\]"):
        pose_points(rig, [0], np.zeros((3, 52)), np.zeros((2, 6)))


def test_a_damaged_cache_is_built_again(rig, tmp_path, monkeypatch):
    monkeypatch.setenv("FACESYNTH_CACHE", str(tmp_path))
    first = load_head()
    (file,) = (tmp_path / "head").iterdir()
    file.write_bytes(file.read_bytes()[:1000])
    again = load_head()
    np.testing.assert_array_equal(first.shapes_mm, again.shapes_mm)
    np.testing.assert_array_equal(again.shapes_mm, rig.shapes_mm)


def test_building_twice_gives_the_same_bytes(rig):
    built = build_head(head_folder())
    assert all(built[name].tobytes() == getattr(rig, name).tobytes() for name in built)


def test_an_absent_head_says_how_to_get_it(monkeypatch, tmp_path):
    monkeypatch.setenv("FACESYNTH_CACHE", str(tmp_path))
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(FacesynthError, match="facesynth fetch head"):
        load_head()
