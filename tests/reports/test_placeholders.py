"""Numbers near the face that stand for a marker that was not seen."""

import numpy as np
import pytest
from test_c3d import NAMES, face

from facesynth.corpus.importers.formats import read


def npz(path, points):
    np.savez(path, frames=points, names=np.array(NAMES), fps=120.0)
    return path


@pytest.mark.parametrize("filler", [[-99, -99, -99], [-50, -50, -50], [-1, -1, -1], [999, 999, 999], [-99, -99, 0], [0, -150, 0]])
@pytest.mark.parametrize("stretches", [[(20, 60)], [(0, 3), (100, 250)], [(297, 300)]])
def test_a_number_beside_the_face_that_stands_is_a_gap_and_told(tmp_path, filler, stretches):
    points = face()
    gaps = np.zeros((300, 6), bool)
    for start, stop in stretches:
        gaps[start:stop, 2] = True
    points[gaps] = filler
    reading = read(npz(tmp_path / "a.npz", points))
    assert np.array_equal(np.isnan(reading.motion.points).any(axis=2), gaps)
    assert f"{gaps.sum()} samples " in " ".join(reading.remarks)
    assert any("they are gaps" in remark for remark in reading.remarks)


def test_it_is_one_for_all_markers_and_for_single_frames_too(tmp_path):
    points = face()
    gaps = np.zeros((300, 6), bool)
    gaps[40:50] = gaps[100, 3] = gaps[200:202, 5] = gaps[:, 1] = True
    points[gaps] = -99
    assert np.array_equal(np.isnan(read(npz(tmp_path / "a.npz", points)).motion.points).any(axis=2), gaps)


def coarse():
    """A face in whole millimetres that moves once in eight frames."""
    return np.repeat(np.round(face(60)), 8, axis=0)


def held():
    """A marker that keeps its last place, at the edge of the face."""
    points = face()
    points[50:80, 4] = points[50, 4]
    points[100:104, 4] = points[:, 4].min(axis=0)
    return points


def clamped():
    """A marker on the frame above the head that never moves."""
    points = face()
    points[:, 1] = [0, 300, 0]
    return points


@pytest.mark.parametrize("points", [coarse(), held(), clamped(), face(), np.tile(face(1), (50, 1, 1))])
def test_what_stands_and_was_measured_is_kept(tmp_path, points):
    reading = read(npz(tmp_path / "a.npz", points))
    np.testing.assert_allclose(reading.motion.points, points, atol=1e-4)
    assert not any("gaps" in remark for remark in reading.remarks)


def test_long_recordings_are_looked_at_across_their_blocks(monkeypatch):
    from facesynth.inference import long_arrays
    from facesynth.motion.placeholders import placeholders

    points = face()
    points[9:12, 2] = points[150:190, 4] = -99
    known = np.zeros((300, 6), bool)
    whole = placeholders(points, known)
    monkeypatch.setattr(long_arrays, "BLOCK_ROWS", 10)
    assert np.array_equal(placeholders(points, known), whole)
    assert whole.sum() == 43
