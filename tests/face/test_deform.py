"""Marker motion spread over the skin."""

import numpy as np
import pytest
import torch

from facesynth.face.deform.mesh_distance import (
    REACH,
    SIGMA,
    MeshDistanceDeformer,
    marker_spacing_mm,
    surface_distances,
    surface_weights,
)
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout


@pytest.fixture(scope="module")
def layout(rig):
    from facesynth.face.rig.markers import marker_layout

    return marker_layout(rig)


@pytest.fixture(scope="module")
def vertices(rig, layout):
    from facesynth.face.rig.markers import marker_vertices

    return marker_vertices(rig, layout)


@pytest.fixture(scope="module")
def deformer(rig, layout):
    return MeshDistanceDeformer(rig, layout)


def moved(deformer, layout, **offsets_mm):
    """Vertex displacements [V, 3] when the named markers move by the given vectors."""
    frame = np.array(layout.neutral, np.float32).reshape(-1, 3)
    for name, offset in offsets_mm.items():
        frame[layout.names.index(name)] += offset
    return deformer(torch.from_numpy(frame.reshape(1, -1)))[0].numpy()


def test_rest_stays_at_rest(deformer, layout):
    assert np.abs(moved(deformer, layout)).max() == 0


def test_a_marker_carries_its_own_vertex_most(rig, deformer, layout, vertices):
    shift = moved(deformer, layout, cheek_l5=[0, 0, 10])
    own = vertices[layout.names.index("cheek_l5")]
    assert shift[own, 2] == shift[:, 2].max()
    assert 6 < shift[own, 2] < 10


def test_lips_do_not_pull_each_other(rig, deformer, layout, vertices):
    down = [0, -10, 0]
    shift = moved(deformer, layout, lower_inner=down, lower_inner_l1=down, lower_inner_r1=down, lower_lip=down)
    upper = [vertices[i] for i in layout.group("upper_lip")]
    assert np.abs(shift[upper]).max() == 0
    assert shift[vertices[layout.names.index("lower_inner")], 1] < -8


def test_paths_go_round_the_corner_of_the_mouth(rig, layout, vertices):
    """Inner lips touch, but the way along the skin is as long as the way to the corner and back."""
    names = layout.names
    upper, lower = (vertices[names.index(name)] for name in ("upper_inner", "lower_inner"))
    straight = np.linalg.norm(rig.rest_mm[upper] - rig.rest_mm[lower])
    along = surface_distances(rig, np.array([upper]))[0, lower]
    assert straight < 2
    assert along > 30


def test_distances_are_a_metric(rig, vertices):
    distance = surface_distances(rig, vertices)[:, vertices]
    np.testing.assert_allclose(distance, distance.T, atol=1e-9)
    assert (np.diag(distance) == 0).all()
    straight = np.linalg.norm(rig.rest_mm[vertices][:, None] - rig.rest_mm[vertices], axis=2)
    assert (distance >= straight - 1e-3).all()
    detour = (distance[:, :, None] + distance[None]).min(axis=1)
    np.testing.assert_allclose(detour, distance, atol=1e-9)  # no way over a third marker is shorter


def test_influence_fades_to_nothing_at_the_threshold(rig, vertices):
    sigma_mm = SIGMA * marker_spacing_mm(rig, vertices)
    weights = surface_weights(rig, vertices)
    total = np.bincount(weights.row, weights.data, minlength=len(rig.rest_mm))
    nearest = surface_distances(rig, vertices).min(axis=0)
    skin = np.isin(np.arange(len(total)), rig.vertices_of("skin"))
    assert total.max() < 1
    assert (total[skin & (nearest > REACH * sigma_mm)] == 0).all()
    edge = skin & (nearest > 0.97 * REACH * sigma_mm) & (nearest < REACH * sigma_mm)
    assert edge.sum() > 3
    assert total[edge].max() < 0.35
    near = skin & (nearest < sigma_mm) & (rig.head_weight > 0.999)
    assert total[near].min() > 0.9


def test_scalp_ears_and_shoulders_stay(rig, deformer, layout):
    frame = np.array(layout.neutral, np.float32).reshape(-1, 3) + np.float32([0, 5, 5])
    shift = deformer(torch.from_numpy(frame.reshape(1, -1)))[0].numpy()
    skin = rig.vertices_of("skin")
    x, y, z = rig.rest_mm[skin].T
    for far in (y > 100, (np.abs(x) > 75) & (y > -40), y < -150, z < 0):
        assert np.abs(shift[skin[far]]).max() == 0


def test_teeth_and_tongue_follow_the_jaw_and_not_the_lips(rig, deformer, layout, vertices):
    from facesynth.face.rig.arkit_rig import pose_points

    inner = rig.vertices_of("lower_teeth", "tongue")
    for shape, weight in (("jawOpen", 0.4), ("mouthLowerDownLeft", 0.8), ("mouthPucker", 0.8)):
        weights = np.zeros((1, 52))
        weights[0, rig.names.index(shape)] = weight
        frame = pose_points(rig, vertices, weights).reshape(1, -1)
        shift = deformer(torch.from_numpy(frame))[0].numpy()
        truth = weight * rig.shapes_mm[rig.names.index(shape), inner]
        assert np.linalg.norm(shift[inner] - truth, axis=1).mean() < 0.06 * np.linalg.norm(truth, axis=1).mean() + 0.5
        assert np.abs(shift[rig.vertices_of("upper_teeth", "left_eye", "right_eye")]).max() == 0


def test_lashes_go_with_the_lid(rig, deformer, layout):
    shift = moved(deformer, layout, upper_lid_l1=[0, -5, 0], upper_lid_l2=[0, -5, 0])
    assert shift[rig.vertices_of("left_upper_lashes"), 1].mean() < -1.5
    assert np.abs(shift[rig.vertices_of("right_upper_lashes")]).max() == 0


def test_fewer_markers_work_too(rig, layout):
    some = layout.names[::3]
    small = Layout("markers", some)
    deformer = MeshDistanceDeformer(rig, small)
    rest = deformer.rest.numpy()
    out = deformer(torch.from_numpy(np.stack([rest, rest + 1, rest]).astype(np.float32)))
    assert out.shape == (3, len(rig.rest_mm), 3)
    assert out[1].abs().max() > 0.9
    assert out[0].abs().max() == 0


def test_state_survives_saving(rig, layout, deformer):
    other = MeshDistanceDeformer(rig, layout, sigma=0.56)
    assert {name for name, _ in other.named_buffers()} == {name for name, _ in deformer.named_buffers()}
    assert not list(deformer.parameters())


def test_bad_layouts_are_refused(rig):
    with pytest.raises(FacesynthError, match="curves"):
        MeshDistanceDeformer(rig, Layout("curves", ("jawOpen",)))
    with pytest.raises(FacesynthError, match="two markers"):
        MeshDistanceDeformer(rig, Layout("markers", ("chin",)))
    with pytest.raises(FacesynthError, match="sigma"):
        MeshDistanceDeformer(rig, Layout("markers", ("chin", "upper_lip")), sigma=0)
