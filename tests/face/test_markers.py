import dataclasses

import numpy as np
import pytest

from facesynth.face.rig.arkit_rig import pose
from facesynth.face.rig.markers import LipGap, marker_layout, marker_vertices
from facesynth.inference.errors import FacesynthError
from facesynth.motion.arkit_names import ARKIT_NAMES


@pytest.fixture(scope="module")
def layout(rig):
    return marker_layout(rig)


def test_90_markers_on_90_different_skin_vertices(rig, layout):
    index = marker_vertices(rig, layout)
    assert len(layout.names) == len(set(index)) == 90
    assert (rig.part[index] == 0).all()
    np.testing.assert_array_equal(layout.points(np.array(layout.neutral, np.float32)), rig.rest_mm[index])


def test_left_markers_mirror_right_ones(layout):
    place = dict(zip(layout.names, layout.points(np.array(layout.neutral)), strict=True))
    for name, point in place.items():
        if "_r" in name and not name.endswith("_root"):
            assert point[0] < 0
            np.testing.assert_allclose(place[name.replace("_r", "_l")], point * [-1, 1, 1], atol=1e-3)


def test_groups_cover_every_marker_once_by_region(layout):
    regions = ("forehead", "brows", "eyelids", "nose", "cheeks", "lips_outer", "lips_inner", "jaw")
    assert sorted(i for region in regions for i in layout.groups[region]) == list(range(90))
    assert len(layout.group("mouth")) == 20
    assert not set(layout.group("upper_lip")) & set(layout.group("lower_lip"))


def test_rigid_markers_hardly_move_with_expression(rig, layout):
    travel = np.linalg.norm(rig.shapes_mm[:, marker_vertices(rig, layout)], axis=-1).max(axis=0)
    assert travel[layout.group("rigid")].max() < 1.2
    assert len(layout.group("rigid")) >= 6


def test_lip_pairs_face_each_other(layout):
    points = layout.points(np.array(layout.neutral))
    for upper, lower in layout.lip_pairs:
        assert np.linalg.norm(points[upper] - points[lower]) < 2


def test_unknown_markers_are_refused(rig, layout):
    with pytest.raises(FacesynthError, match="elbow"):
        marker_vertices(rig, dataclasses.replace(layout, names=("elbow", *layout.names[1:])))


def test_the_jaw_opens_the_lips_by_34_mm(rig):
    gap, open_jaw = LipGap.of(rig), np.zeros(52)
    open_jaw[ARKIT_NAMES.index("jawOpen")] = 1
    assert gap.gaps_mm(open_jaw)[3] - gap.rest_mm[3] == pytest.approx(34, abs=1)
    np.testing.assert_allclose(gap.rest_mm, gap.rest_mm[::-1], atol=1e-3)


def test_gaps_are_those_of_the_posed_mesh(rig):
    values = np.random.default_rng(2).random(52)
    vertices = pose(rig, values)
    upper, lower = rig.from_source([515, 520, 7262]), rig.from_source([535, 540, 7280])
    assert LipGap.of(rig).opening_mm(values) == pytest.approx((vertices[upper] - vertices[lower])[:, 1].mean(), abs=1e-3)


def test_closing_reaches_the_target_and_never_opens(rig):
    gap = LipGap.of(rig)
    values = np.random.default_rng(3).random((20, 52)) * 0.3
    values[:, ARKIT_NAMES.index("jawOpen")] = np.linspace(0, 1, 20)
    before, after = gap.opening_mm(values), gap.opening_mm(gap.closed(values, 0.5))
    np.testing.assert_allclose(after, np.minimum(before, 0.5), atol=1e-6)
    half = gap.opening_mm(gap.closed(values, 0.5, 0.5))
    np.testing.assert_allclose(half, np.where(before > 0.5, (before + 0.5) / 2, before), atol=1e-6)
