import numpy as np
import pytest

from facesynth.face.rig.markers import HEAD_MARKERS

MARKERS = {name: vertex for region in HEAD_MARKERS.values() for name, vertex in region}


def moved_mm(rig, marker, *shapes):
    """Displacement [3] of a marker under shapes at weight 1."""
    (vertex,) = rig.from_source([MARKERS[marker]])
    return rig.shapes_mm[rig.index(*shapes), vertex].sum(axis=0)


def test_raised_inner_brows_slant(rig):
    inner, outer = (moved_mm(rig, f"brow_l{k}", "browInnerUp")[1] for k in (1, 4))
    assert 8 <= inner <= 10
    assert abs(outer) < 1


def test_lowered_brows_come_together_and_slant_the_other_way(rig):
    inner, outer = (moved_mm(rig, f"brow_l{k}", "browDownLeft", "browDownRight") for k in (1, 4))
    assert inner[1] < -7
    assert inner[1] < outer[1] - 5
    assert inner[0] < -4  # towards the middle
    assert np.abs(moved_mm(rig, "brow_r1", "browDownLeft")).max() < 0.1


def test_raised_outer_brows_leave_the_inner_ends(rig):
    assert moved_mm(rig, "brow_l4", "browOuterUpLeft")[1] > 5
    assert abs(moved_mm(rig, "brow_l1", "browOuterUpLeft")[1]) < 1


def test_sorrow_keeps_inner_ends_up_although_brows_are_drawn_together(rig):
    both = moved_mm(rig, "brow_l1", "browInnerUp") + 0.4 * moved_mm(rig, "brow_l1", "browDownLeft")
    assert both[1] > 4
    assert both[0] < -2


@pytest.mark.parametrize("shape", ["browInnerUp", "browDownLeft", "browDownRight", "browOuterUpLeft", "browOuterUpRight"])
def test_brows_move_neither_mouth_nor_lashes_nor_the_top_of_the_forehead(rig, shape):
    still = (rig.part != 0) | (rig.rest_mm[:, 1] < -12) | (rig.rest_mm[:, 1] > 58)
    assert np.abs(rig.shapes_mm[rig.index(shape)[0], still]).max() == 0


def test_a_frown_lowers_the_corners_of_the_mouth_by_7_mm(rig):
    assert moved_mm(rig, "mouth_corner_l", "mouthFrownLeft")[1] == pytest.approx(-7, abs=0.5)
