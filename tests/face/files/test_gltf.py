"""The head as glTF: valid by the format's rules, and moving as the rig does."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from facesynth.face.animation import FaceAnimation
from facesynth.face.files.formats import write_animation
from facesynth.face.rig.arkit import gaze_weights
from facesynth.face.rig.arkit_rig import pose
from facesynth.motion.arkit_names import ARKIT_NAMES

_spec = importlib.util.spec_from_file_location("gltf_rules", Path(__file__).with_name("gltf_rules.py"))
gltf_rules = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(gltf_rules)


def animation_at(fps, count):
    phase = np.arange(count)[:, None] / fps
    weights = 0.3 + 0.3 * np.sin(phase * np.linspace(3, 30, 52))
    head = np.sin(phase * np.arange(1, 7)) * [0.2, 0.3, 0.1, 4, 3, 2]
    gaze = np.sin(phase * [2, 3]) * [0.2, 0.1]
    weights = gaze_weights(weights, gaze)
    return FaceAnimation(ARKIT_NAMES, weights, head, gaze, np.zeros(count), fps)


@pytest.fixture(scope="module")
def animation():
    return animation_at(30000 / 1001, 60)


@pytest.fixture(scope="module")
def glb(rig, animation, tmp_path_factory):
    path = tmp_path_factory.mktemp("glb") / "speech.glb"
    write_animation(path, animation, rig)
    return gltf_rules.Glb(path.read_bytes())


def test_the_file_keeps_the_rules_of_the_format(glb):
    gltf_rules.check(glb)


@pytest.mark.parametrize(("fps", "count"), [(24000 / 1001, 1), (120.0, 2), (60.0, 7)])
def test_other_rates_and_lengths_keep_them_too(rig, tmp_path, fps, count):
    write_animation(tmp_path / "a.glb", animation_at(fps, count), rig)
    gltf_rules.check(gltf_rules.Glb((tmp_path / "a.glb").read_bytes()))


def test_the_checker_sees_broken_files(glb):
    broken = gltf_rules.Glb.__new__(gltf_rules.Glb)
    import copy

    for spoil in (
        lambda doc: doc["accessors"][0].update(count=10**7),
        lambda doc: doc["accessors"][0]["max"].__setitem__(0, 5.0),
        lambda doc: doc["meshes"][0]["extras"]["targetNames"].pop(),
        lambda doc: doc["nodes"][1]["children"].append(3),
        lambda doc: doc["bufferViews"][1].update(byteOffset=4),
    ):
        broken.doc, broken.data = copy.deepcopy(glb.doc), glb.data
        spoil(broken.doc)
        with pytest.raises((AssertionError, ValueError)):
            gltf_rules.check(broken)


def test_shapes_are_named(glb):
    assert glb.doc["meshes"][0]["extras"]["targetNames"] == list(ARKIT_NAMES)
    assert [node["name"] for node in glb.doc["nodes"]] == ["face", "torso", "head", "left_eye", "right_eye"]


def test_times_are_the_frames(glb, animation):
    for sampler in glb.doc["animations"][0]["samplers"]:
        np.testing.assert_allclose(glb.array(sampler["input"])[:, 0], animation.times_s, atol=1e-6)


@pytest.mark.parametrize("frame", [0, 20, 59])
def test_a_player_sees_what_the_rig_poses(rig, glb, animation, frame):
    """Morph, skin and turn as a viewer does; every vertex lies where `pose` puts it."""
    played = played_mm(glb, frame)
    wanted = pose(rig, animation.weights[frame], animation.head[frame], animation.gaze[frame])
    distance, _ = KDTree(wanted).query(played)
    assert distance.max() < 1e-2
    assert KDTree(played).query(wanted[np.unique(rig.quads)])[0].max() < 1e-2


def test_fifteen_seconds_are_small(rig, tmp_path):
    write_animation(tmp_path / "a.glb", animation_at(60.0, 900), rig)
    assert (tmp_path / "a.glb").stat().st_size < 15e6


def test_faces_look_outwards(rig, glb):
    """Triangles wind counter-clockwise seen from outside: on the forehead their normals point forwards."""
    primitive = glb.doc["meshes"][0]["primitives"][0]
    points = glb.array(primitive["attributes"]["POSITION"])
    a, b, c = points[glb.array(primitive["indices"]).reshape(-1, 3).T]
    middle, normal = (a + b + c) / 3, np.cross(b - a, c - a)
    forehead = (np.abs(middle[:, 0]) < 0.04) & (np.abs(middle[:, 1] - 0.04) < 0.02) & (middle[:, 2] > 0.1)
    assert forehead.sum() > 20
    assert (normal[forehead, 2] > 0).all()


def played_mm(glb, frame):
    doc = glb.doc
    now = {}
    for channel in doc["animations"][0]["channels"]:
        values = glb.array(doc["animations"][0]["samplers"][channel["sampler"]]["output"])
        values = values.reshape(-1, 52) if channel["target"]["path"] == "weights" else values
        now[channel["target"]["node"], channel["target"]["path"]] = values[frame]
    primitive = doc["meshes"][0]["primitives"][0]
    face = glb.array(primitive["attributes"]["POSITION"]).astype(float)
    for weight, target in zip(now[0, "weights"], primitive["targets"], strict=True):
        face += weight * glb.array(target["POSITION"])
    head = matrix(now[2, "rotation"], now[2, "translation"])
    joints = [np.eye(4), head]
    binds = glb.array(doc["skins"][0]["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)
    weights, index = glb.array(primitive["attributes"]["WEIGHTS_0"]), glb.array(primitive["attributes"]["JOINTS_0"])
    skin = np.stack([joint @ bind for joint, bind in zip(joints, binds, strict=True)])
    blended = np.einsum("vj,vjab->vab", weights, skin[index])
    parts = [np.einsum("vab,vb->va", blended, np.column_stack([face, np.ones(len(face))]))[:, :3]]
    for node, mesh in ((3, 1), (4, 2)):
        place = head @ matrix(now[node, "rotation"], doc["nodes"][node]["translation"])
        ball = glb.array(doc["meshes"][mesh]["primitives"][0]["attributes"]["POSITION"])
        parts.append((np.column_stack([ball, np.ones(len(ball))]) @ place.T)[:, :3])
    return 1000 * np.concatenate(parts)


def matrix(quaternion, translation):
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = Rotation.from_quat(quaternion).as_matrix(), translation
    return out
