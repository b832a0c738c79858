import dataclasses

import numpy as np
import pytest
import torch

from facesynth.face.deform.mesh_distance import edge_lengths
from facesynth.face.deform.regions import REGIONS, RegionDeformer, region_markers, region_shares
from facesynth.face.rig.markers import marker_layout, marker_vertices
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout


@pytest.fixture(scope="module")
def layout(rig):
    return marker_layout(rig)


@pytest.fixture(scope="module")
def deformer(rig, layout):
    return RegionDeformer(rig, layout)


def moved(deformer, layout, names, offset_mm):
    frames = np.array(layout.neutral, np.float32).reshape(1, -1, 3).copy()
    frames[:, [layout.names.index(name) for name in names]] += np.asarray(offset_mm, np.float32)
    return deformer(torch.from_numpy(frames.reshape(1, -1)))[0].numpy()


def of_group(layout, group, without=()):
    return [layout.names[i] for i in layout.groups[group] if layout.names[i] not in without]


def test_rest_stays_at_rest(deformer, layout):
    assert np.abs(moved(deformer, layout, [], 0)).max() == 0


def test_markers_take_their_vertices_along(rig, deformer, layout):
    rng = np.random.default_rng(0)
    offsets = rng.normal(size=(len(layout.names), 3)).astype(np.float32)
    frames = np.array(layout.neutral, np.float32) + offsets.ravel()
    displacement = deformer(torch.from_numpy(frames[None]))[0].numpy()[marker_vertices(rig, layout)]
    named = np.unique(np.concatenate(list(region_markers(rig, layout, marker_vertices(rig, layout)).values())))
    error = np.linalg.norm(displacement - offsets, axis=1)[named]
    assert np.median(error) < 0.02
    assert np.percentile(error, 80) < 0.25 * np.linalg.norm(offsets, axis=1).mean()


@pytest.mark.parametrize(("pulling", "still"), [("lower_lip", "upper_lip"), ("upper_lip", "lower_lip")])
def test_lips_never_pull_each_other(rig, deformer, layout, pulling, still):
    down = moved(deformer, layout, of_group(layout, pulling), (0, -10, 0))
    vertices = marker_vertices(rig, layout)
    own = vertices[layout.group(pulling)]
    other = vertices[layout.group(still)]
    assert down[own, 1].max() < -8
    assert np.abs(down[other]).max() < 0.3


def test_jaw_drop_leaves_the_upper_face_alone(rig, deformer, layout):
    down = moved(deformer, layout, of_group(layout, "jaw") + of_group(layout, "lower_lip"), (0, -12, 0))
    vertices = marker_vertices(rig, layout)
    for group in ("brows", "eyelids", "forehead", "nose"):
        assert np.abs(down[vertices[layout.group(group)]]).max() < 0.1


def test_eyelids_close_apart_from_each_other(rig, deformer, layout):
    right = [n for n in of_group(layout, "eyelids") if "upper_lid_r" in n]
    down = moved(deformer, layout, right, (0, -6, 0))
    vertices = marker_vertices(rig, layout)
    for name in right:
        assert down[vertices[layout.names.index(name)], 1] < -4
    left = [i for i, n in enumerate(layout.names) if "lid_l" in n]
    assert np.abs(down[vertices[left]]).max() == 0


def test_every_vertex_belongs_somewhere_and_borders_are_smooth(rig, layout):
    vertices = marker_vertices(rig, layout)
    members = region_markers(rig, layout, vertices)
    shares = region_shares(rig, vertices, members, 8.0)
    assert shares.shape == (len(REGIONS), len(rig.rest_mm))
    skin = rig.vertices_of("skin")
    touched = shares[:, skin].sum(axis=0)
    assert set(np.round(touched, 6)) <= {0.0, 1.0}
    assert (touched == 0).mean() < 0.01
    assert ((shares > 0.05) & (shares < 0.95)).any(axis=1).sum() >= 4


def test_a_moving_face_has_no_cracks(rig, deformer, layout):
    rng = np.random.default_rng(1)
    weights = rng.uniform(0, 0.6, 52)
    offsets = np.einsum("s,svc->vc", weights, rig.shapes_mm)[marker_vertices(rig, layout)].astype(np.float32)
    frames = np.array(layout.neutral, np.float32) + offsets.ravel()
    displacement = deformer(torch.from_numpy(frames[None]))[0].numpy()
    edges = edge_lengths(rig).tocoo()
    skin = np.isin(edges.row, rig.vertices_of("skin")) & np.isin(edges.col, rig.vertices_of("skin"))
    stretch = np.linalg.norm(displacement[edges.row] - displacement[edges.col], axis=1)[skin]
    assert stretch.max() < 0.6 * np.linalg.norm(offsets, axis=1).max()
    assert np.isfinite(displacement).all()


def test_a_layout_without_eyelids_is_told_so(rig, layout):
    groups = {name: members for name, members in layout.groups.items() if name != "eyelids"}
    with pytest.raises(FacesynthError, match="right eyelid"):
        RegionDeformer(rig, dataclasses.replace(layout, groups=groups))
    with pytest.raises(FacesynthError, match="markers"):
        RegionDeformer(rig, Layout("curves", ("a",)))
