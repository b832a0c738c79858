"""Faults that are planted in one recording: named as what they are, and by the points that they are of."""

from dataclasses import replace

import numpy as np
import pytest
from corpora import tiny_layout, tiny_utterances

from facesynth.corpus.checks.motion import motion_problems
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion

FPS = 60.0
ROWS, COLUMNS = 9, 12
NAMES = tuple(f"p{k:03d}" for k in range(ROWS * COLUMNS))


@pytest.fixture(scope="module")
def face():
    """108 points 8 mm apart on a bent mask, of which the lower third moves by up to 10 mm, for two seconds."""
    x, y = np.meshgrid(np.linspace(-44, 44, COLUMNS), np.linspace(40, -40, ROWS))
    rest = np.stack([x, 1.5 * y, 60 - (x / 12) ** 2 - (y / 20) ** 2], axis=2).reshape(-1, 3)
    seconds = np.arange(120) / FPS
    motion = np.tile(rest, (120, 1, 1)) + 0.05 * np.random.default_rng(0).standard_normal((120, len(rest), 3))
    motion[:, 72:, 1] -= (5 * np.sin(2 * np.pi * 2 * seconds) ** 2)[:, None] * (1 + (rest[72:, 1] < -50))
    groups = {"brows": tuple(range(COLUMNS, 2 * COLUMNS)), "mouth": tuple(range(75, 81)), "jaw": tuple(range(96, 108))}
    return Motion(motion.reshape(120, -1).astype(np.float32), FPS, Layout("markers", NAMES, groups, (), tuple(rest.ravel())))


def told(motion):
    return [problem.what for problem in motion_problems("f", "u", motion, None)]


def changed(face, change, **layout):
    points = np.array(change(face.points.astype(np.float64).copy()))
    return Motion(points.reshape(len(points), -1).astype(np.float32), FPS, replace(face.layout, **layout))


def exchanged(first, second, frames=slice(None)):
    def change(points):
        points[frames, first], points[frames, second] = points[frames, second].copy(), points[frames, first].copy()
        return points

    return change


def test_nothing_is_wrong_with_a_good_face(face):
    assert told(face) == []
    assert told(changed(face, lambda points: points, neutral=None)) == []


@pytest.mark.parametrize("pair", [(0, 1), (13, 37), (20, 46), (52, 55), (75, 80), (90, 104), (5, 100), (30, 41)])
def test_the_points_that_are_swapped_are_named_and_no_others(face, pair):
    names = " and ".join(NAMES[k] for k in pair)
    assert told(changed(face, exchanged(*pair))) == [f"{names} are swapped throughout"]
    from_a_frame_on = [what for what in told(changed(face, exchanged(*pair, slice(48, None)))) if "jumps" not in what]
    assert from_a_frame_on == [f"{names} are swapped from 0.80 to 2.00 s"]
    meanwhile = [what for what in told(changed(face, exchanged(*pair, slice(48, 60)))) if "jumps" not in what]
    assert meanwhile == [f"{names} are swapped from 0.80 to 1.00 s"]


def test_two_pairs_at_once_are_told_apart(face):
    swapped = changed(face, lambda points: exchanged(13, 37)(exchanged(14, 38)(points)))
    assert told(swapped) == ["p013 and p037 are swapped throughout", "p014 and p038 are swapped throughout"]


def test_a_swap_is_found_without_a_rest_pose_where_it_does_not_last(face):
    found = told(changed(face, exchanged(52, 55, slice(90, None)), neutral=None))
    assert "p052 and p055 are swapped from 1.50 to 2.00 s" in found


@pytest.mark.parametrize(
    ("turn", "message"),
    [
        ((1, -1, 1), "its y axis is flipped; the face is upside down"),
        ((-1, 1, 1), "its x axis is flipped; left and right are mirrored"),
        ((1, 1, -1), "its z axis is flipped"),
        ((1, -1, -1), "its y and z axes are flipped; the face is upside down"),
    ],
)
def test_flipped_axes_are_called_so_and_nothing_else(face, turn, message):
    (problem,) = motion_problems("f", "u", changed(face, lambda points: points * turn), None)
    assert message in problem.what
    assert "swapped" not in problem.what
    signs = ",".join("-" * (sign < 0) + axis for axis, sign in zip("xyz", turn, strict=True))
    assert problem.do.startswith(f"convert it with the axes {signs}")


def test_exchanged_axes_are_told_with_the_ones_to_take(face):
    (problem,) = motion_problems("f", "u", changed(face, lambda points: points[..., [0, 2, 1]] * [1, -1, 1]), None)
    assert problem.what == "its axes are exchanged: what the rest pose calls x, y, z is its x, z, -y"
    assert problem.do.startswith("convert it with the axes x,z,-y")


def test_a_face_that_is_upside_down_in_its_rest_pose_too_is_found(face):
    upside = np.reshape(face.layout.neutral, (-1, 3)) * [1, -1, 1]
    for neutral in (tuple(upside.ravel()), None):
        (what,) = told(changed(face, lambda points: points * [1, -1, 1], neutral=neutral))
        assert "upside down" in what


@pytest.mark.parametrize(
    ("scale", "unit"),
    [
        (1e-3, "metres"),
        (1e-2, "decimetres"),
        (0.1, "centimetres"),
        (1 / 25.4, "inches"),
        (10.0, "tenths of a millimetre"),
        (1e3, "micrometres"),
    ],
)
@pytest.mark.parametrize("whole", [False, True], ids=["motion", "rest pose too"])
def test_units_are_told_by_the_rest_pose_or_by_how_wide_a_mouth_is(face, scale, unit, whole):
    neutral = tuple((np.array(face.layout.neutral) * (scale if whole else 1)).tolist())
    (what,) = told(changed(face, lambda points: points * scale, neutral=neutral))
    assert what.endswith(f"; in {unit}?")
    assert ("than the rest pose" in what) != whole


def test_a_size_that_no_unit_explains_is_told_without_a_guess(face):
    (what,) = told(changed(face, lambda points: points * 3))
    assert what == "the face is 3.08 times larger than the rest pose of corpus.yaml"


@pytest.mark.parametrize(
    ("largest", "message"), [(100, "in per cent?"), (60, "in per cent?"), (255, "from 0 to 255?"), (1e4, "wanted 0 to 1")]
)
def test_weights_that_are_not_from_0_to_1_are_found(largest, message):
    layout = Layout("curves", ("jawOpen", "mouthSmileLeft"))
    frames = np.column_stack([np.linspace(0, largest, 50), np.linspace(0, largest / 2, 50)]).astype(np.float32)
    (what,) = told(Motion(frames, 30.0, layout))
    assert message in what
    assert "jawOpen" in what
    assert told(Motion(frames / largest * 1.2, 30.0, layout)) == [], "an exaggeration is no fault"


def test_landmarks_in_shares_of_the_picture_and_upside_down_are_found(face):
    flat = face.points[..., :2] * 2.0
    layout = replace(face.layout, kind="landmarks", neutral=tuple((np.reshape(face.layout.neutral, (-1, 3))[:, :2] * 2).ravel()))
    good = Motion(flat.reshape(120, -1) + np.float32(300), FPS, layout)
    assert told(good) == []
    (shares,) = told(Motion(good.frames / 720, FPS, layout))
    assert "are these shares of the picture (0 to 1)?" in shares
    (shares,) = told(Motion(good.frames / 720, FPS, replace(layout, neutral=None)))
    assert "are these shares of the picture (0 to 1)?" in shares
    (upside,) = told(Motion((flat * [1, -1] + 300).reshape(120, -1).astype(np.float32), FPS, layout))
    assert "y axis is flipped" in upside


def test_a_point_that_stops_while_others_move_is_found(face):
    def stop(points):
        points[30:, 55] = points[30, 55]
        return points

    assert told(changed(face, stop)) == ["frozen from 0.50 to 1.98 s while others move: p055"]


def test_many_points_that_stop_together_are_one_problem(face):
    def stop(points):
        points[30:80, :50] = points[30, :50]
        return points

    (problem,) = motion_problems("f", "u", changed(face, stop), None)
    assert problem.what == "frozen from 0.50 to 1.32 s while others move: p000, p001, p002, p003, p004, p005 and 44 more"
    assert problem.grave


def test_pauses_repeated_frames_and_coarse_files_are_no_frozen_points(face):
    def held(points):
        points[30:55, 55] = points[30, 55]
        return points

    assert told(changed(face, held)) == [], "under half a second"
    assert told(changed(face, lambda points: np.repeat(points, 2, axis=0)[:120])) == []
    coarse = [what for what in told(changed(face, np.round)) if "frozen from" in what]
    assert coarse == []
    gone = face.points.astype(np.float64).copy()
    gone[20:70, 55] = np.nan
    assert told(changed(face, lambda points: gone)) == []


def test_clean_utterances_have_no_faults():
    for _, _, motion in tiny_utterances(6):
        assert told(motion) == []
    assert tiny_layout().neutral is not None
