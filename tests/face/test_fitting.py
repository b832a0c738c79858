import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from facesynth.face.rig.arkit_rig import pose_points
from facesynth.face.rig.markers import LipGap, marker_layout, marker_vertices
from facesynth.face.solve.animate import animate
from facesynth.face.solve.fitting import fit_layout, is_of_the_head, rest_of, similarity
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.motion.arkit_names import ARKIT_NAMES

SCALE = 1.15
TURN = Rotation.from_rotvec([0.1, -0.15, 0.05]).as_matrix()
SHIFT = np.array([10.0, -20.0, 30.0])


@pytest.fixture(scope="module")
def talk(rig):
    """Weights [60, 52] of a mouth that opens, rounds and smiles, and the head's markers under them [60, 90, 3]."""
    phase = np.linspace(0, 6, 60)
    weights = np.zeros((60, 52))
    for name, wave in (("jawOpen", 0.3 * np.sin(phase) ** 2), ("mouthPucker", 0.4 * np.cos(phase) ** 2)):
        weights[:, ARKIT_NAMES.index(name)] = wave
    for side in ("Left", "Right"):
        weights[:, ARKIT_NAMES.index(f"mouthSmile{side}")] = 0.3 * np.sin(0.5 * phase) ** 2
    return weights, pose_points(rig, marker_vertices(rig, marker_layout(rig)), weights)


def elsewhere(points):
    """The same points on a larger face that another system measured."""
    return SCALE * points @ TURN + SHIFT


def renamed(rig, rename, keep=None):
    """The head's own layout under other names, seen elsewhere."""
    layout = marker_layout(rig)
    keep = np.arange(len(layout.names)) if keep is None else keep
    order = {int(old): new for new, old in enumerate(keep)}
    groups = {g: tuple(order[i] for i in members if i in order) for g, members in layout.groups.items()}
    pairs = tuple((order[a], order[b]) for a, b in layout.lip_pairs if a in order and b in order)
    neutral = elsewhere(layout.points(np.array(layout.neutral))[keep]).ravel()
    names = tuple(rename(layout.names[i], i) for i in keep)
    return Layout("markers", names, groups, pairs, tuple(neutral.tolist())), keep


def spoken(rig, talk, layout, keep):
    motion = Motion(elsewhere(talk[1].astype(float))[:, keep].reshape(60, -1), 60.0, layout)
    return animate(motion, rig, eyes_gain=0).weights


def test_the_heads_own_markers_are_known(rig):
    assert is_of_the_head(marker_layout(rig))
    assert not is_of_the_head(Layout("markers", ("chin", "antenna")))


def test_a_similarity_is_found_exactly():
    points = np.random.default_rng(0).normal(size=(20, 3))
    turn, scale, shift = similarity(points, elsewhere(points))
    np.testing.assert_allclose(turn, TURN, atol=1e-9)
    assert scale == pytest.approx(SCALE)
    np.testing.assert_allclose(shift, SHIFT, atol=1e-9)


def test_known_names_in_any_order_on_another_face_give_the_same_weights(rig, talk):
    keep = np.random.default_rng(1).permutation(90)
    layout, keep = renamed(rig, lambda name, i: name if i % 9 else f"extra{i}", keep)
    fit = fit_layout(rig, layout)
    assert fit.named
    assert len(fit.points) == 80
    assert fit.distance_mm.max() < 0.01
    found = spoken(rig, talk, layout, keep)
    jaw = ARKIT_NAMES.index("jawOpen")
    assert np.abs(found[:, jaw] - talk[0][:, jaw]).max() < 0.03


def test_names_of_landmarks_from_video_find_their_place(rig):
    from facesynth.face.solve.landmark_names import LANDMARKS

    own = marker_layout(rig)
    names = tuple(f"p{number:03d}" for number in range(468))
    neutral = np.random.default_rng(2).normal(0, 30, (468, 3))
    for name, marker in LANDMARKS.items():
        neutral[int(name[1:])] = elsewhere(own.points(np.array(own.neutral))[own.names.index(marker)])
    fit = fit_layout(rig, Layout("markers", names, neutral=tuple(neutral.ravel().tolist())))
    assert len(fit.points) == len(LANDMARKS) > 70
    assert fit.distance_mm.max() < 0.01
    assert np.linalg.norm(fit.linear[0]) == pytest.approx(1 / SCALE, rel=1e-3)


def test_numbered_markers_are_fitted_by_shape_and_lips_stay_apart(rig, talk):
    """109 or 90 markers of which nobody says what they are, but groups and lip pairs are told."""
    layout, keep = renamed(rig, lambda name, i: f"M{i:03d}")
    fit = fit_layout(rig, layout)
    assert not fit.named
    own = rig.rest_mm[marker_vertices(rig, marker_layout(rig))]
    off = np.linalg.norm(rig.rest_mm[fit.vertices] - own[fit.points], axis=1)
    assert np.median(off) < 6
    found = spoken(rig, talk, layout, keep)
    jaw = ARKIT_NAMES.index("jawOpen")
    assert np.corrcoef(found[:, jaw], talk[0][:, jaw])[0, 1] > 0.95
    gaps = LipGap.of(rig)
    asked, shown = gaps.opening_mm(talk[0]), gaps.opening_mm(found)
    assert np.corrcoef(asked, shown)[0, 1] > 0.98
    assert shown[asked < 1].max() < 1.5, "lips that are shut stay shut"


def test_seven_sensors_of_articulography_move_the_head(rig, talk):
    names = ("TR", "TB", "TT", "UL", "LL", "ML", "JAW")
    own = marker_layout(rig).names
    columns = [own.index(name) for name in ("upper_lip", "lower_lip", "mouth_corner_l", "chin")]
    points = np.zeros((60, 7, 3))
    points[:, 3:] = talk[1][:, columns] + SHIFT
    layout = Layout("markers", names, {"tongue": (0, 1, 2)}, ((3, 4),))
    motion = Motion(points.reshape(60, -1), 60.0, layout)
    fit = fit_layout(rig, layout, rest_of(motion))
    assert fit.points.tolist() == [3, 4, 5, 6]
    np.testing.assert_allclose(fit.linear, np.eye(3))
    weights = animate(motion, rig, eyes_gain=0).weights
    shown, asked = (LipGap.of(rig).opening_mm(w) for w in (weights, talk[0]))
    assert np.corrcoef(shown, asked)[0, 1] > 0.95


def test_landmarks_in_a_picture_move_the_head(rig, talk):
    own = marker_layout(rig)
    flat = 3.0 * talk[1][:, :, :2] + [400, 300]
    rest = 3.0 * own.points(np.array(own.neutral))[:, :2] + [400, 300]
    layout = Layout("landmarks", own.names, own.groups, own.lip_pairs, tuple(rest.ravel().tolist()))
    weights = animate(Motion(flat.reshape(60, -1), 60.0, layout), rig, eyes_gain=0).weights
    shown, asked = (LipGap.of(rig).opening_mm(w) for w in (weights, talk[0]))
    assert np.abs(shown - np.maximum(asked, 0)).max() < 1.0, "lips that would cross touch"


def test_the_pose_of_another_face_turns_the_head_about_the_same_place(rig):
    layout, _ = renamed(rig, lambda name, i: name if i % 9 else f"extra{i}")
    head = np.tile([0.2, 0.1, 0, 1, 2, 3], (4, 1)).astype(np.float32)
    frames = np.tile(layout.neutral, (4, 1))
    animation = animate(Motion(frames, 60.0, layout, head), rig)
    own = animate(Motion(np.tile(marker_layout(rig).neutral, (4, 1)), 60.0, marker_layout(rig), head), rig)
    np.testing.assert_allclose(animation.head[:, :3], own.head[:, :3], atol=1e-6)
    np.testing.assert_allclose(animation.head[:, 3:], own.head[:, 3:], atol=0.5)


def test_what_cannot_be_placed_says_why(rig):
    with pytest.raises(FacesynthError, match="by their rest pose"):
        fit_layout(rig, Layout("markers", ("a", "b")))
    with pytest.raises(FacesynthError, match="by their names"):
        fit_layout(rig, Layout("landmarks", ("a", "b"), neutral=(0.0,) * 4))
    with pytest.raises(FacesynthError, match="lacks the points b"):
        fit_layout(rig, Layout("markers", ("a", "b"), neutral=(0.0, 0, 0, np.nan, 0, 0)))
