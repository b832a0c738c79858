"""The rules of glTF 2.0 that a .glb of facesynth could break, checked without the library that wrote it."""

import json
import struct

import numpy as np

DTYPES = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
ARRAY, ELEMENT = 34962, 34963


class Glb:
    """A .glb taken apart by hand."""

    def __init__(self, content):
        magic, version, length, json_length, json_kind = struct.unpack("<4s2I2I", content[:20])
        assert (magic, version, length, json_kind) == (b"glTF", 2, len(content), 0x4E4F534A)
        assert length % 4 == json_length % 4 == 0
        self.doc = json.loads(content[20 : 20 + json_length])
        rest = content[20 + json_length :]
        bin_length, bin_kind = struct.unpack("<2I", rest[:8])
        assert (bin_kind, bin_length) == (0x004E4942, len(rest) - 8)
        self.data = rest[8:]

    def array(self, index):
        """[count, width] the values of an accessor."""
        accessor = self.doc["accessors"][index]
        view = self.doc["bufferViews"][accessor["bufferView"]]
        dtype, width = np.dtype(DTYPES[accessor["componentType"]]), WIDTHS[accessor["type"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        flat = np.frombuffer(self.data, dtype, accessor["count"] * width, start)
        return flat.reshape(-1, width)


def check(glb):
    """Assert every rule."""
    doc = glb.doc
    assert doc["asset"]["version"] == "2.0"
    assert len(doc["buffers"]) == 1
    assert "uri" not in doc["buffers"][0]
    assert 0 <= len(glb.data) - doc["buffers"][0]["byteLength"] <= 3
    check_views_and_accessors(glb)
    for mesh in doc["meshes"]:
        check_mesh(glb, mesh)
    check_nodes(doc)
    for skin in doc.get("skins", []):
        check_skin(glb, skin)
    for animation in doc["animations"]:
        check_animation(glb, animation)
    for image in doc.get("images", []):
        view = doc["bufferViews"][image["bufferView"]]
        magic = {"image/png": b"\x89PNG", "image/jpeg": b"\xff\xd8\xff"}[image["mimeType"]]
        assert glb.data[view["byteOffset"] :].startswith(magic)
    assert_no_empty_values(doc)


def check_views_and_accessors(glb):
    end = 0
    for view in glb.doc["bufferViews"]:
        assert view.get("byteOffset", 0) >= end, "views overlap"
        end = view.get("byteOffset", 0) + view["byteLength"]
        assert view["byteLength"] > 0
        assert "byteStride" not in view
    assert end <= glb.doc["buffers"][0]["byteLength"]
    for index, accessor in enumerate(glb.doc["accessors"]):
        view = glb.doc["bufferViews"][accessor["bufferView"]]
        size = np.dtype(DTYPES[accessor["componentType"]]).itemsize
        element = size * WIDTHS[accessor["type"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        assert start % size == 0
        assert accessor["count"] >= 1
        assert accessor.get("byteOffset", 0) + accessor["count"] * element <= view["byteLength"]
        if view.get("target") == ARRAY:
            assert element % 4 == 0, "vertex attributes are aligned to four bytes"
        values = glb.array(index)
        assert np.isfinite(values.astype(float)).all()
        if "min" in accessor:
            np.testing.assert_array_equal(np.float32(accessor["min"]), values.min(axis=0))
            np.testing.assert_array_equal(np.float32(accessor["max"]), values.max(axis=0))


def check_mesh(glb, mesh):
    counts = {len(primitive.get("targets", [])) for primitive in mesh["primitives"]}
    assert len(counts) == 1
    assert len(mesh.get("weights", [])) in (0, *counts)
    names = mesh.get("extras", {}).get("targetNames", [])
    assert len(names) == len(set(names)) == counts.copy().pop()
    for primitive in mesh["primitives"]:
        attributes = primitive["attributes"]
        accessors = {name: glb.doc["accessors"][index] for name, index in attributes.items()}
        count = accessors["POSITION"]["count"]
        assert {accessor["count"] for accessor in accessors.values()} == {count}
        assert accessors["POSITION"]["type"] == accessors["NORMAL"]["type"] == "VEC3"
        assert {"min", "max"} <= set(accessors["POSITION"])
        np.testing.assert_allclose(np.linalg.norm(glb.array(attributes["NORMAL"]), axis=1), 1, atol=1e-3)
        indices = glb.array(primitive["indices"])
        assert glb.doc["accessors"][primitive["indices"]]["componentType"] in (5121, 5123, 5125)
        assert glb.doc["bufferViews"][glb.doc["accessors"][primitive["indices"]]["bufferView"]]["target"] == ELEMENT
        assert len(indices) % 3 == 0
        assert indices.max() < count
        triangles = indices.reshape(-1, 3)
        assert (triangles[:, [0, 1, 2]] != triangles[:, [1, 2, 0]]).all(), "a triangle has no area"
        assert primitive["material"] < len(glb.doc["materials"])
        for target in primitive.get("targets", []):
            assert set(target) <= {"POSITION", "NORMAL"}
            assert {glb.doc["accessors"][index]["count"] for index in target.values()} == {count}
            assert {"min", "max"} <= set(glb.doc["accessors"][target["POSITION"]])
        if "WEIGHTS_0" in attributes:
            weights, joints = glb.array(attributes["WEIGHTS_0"]), glb.array(attributes["JOINTS_0"])
            np.testing.assert_allclose(weights.sum(axis=1), 1, atol=2e-6)
            assert weights.min() >= 0
            assert (joints[weights == 0] == 0).all(), "unused joints are 0"


def check_nodes(doc):
    parents = [child for node in doc["nodes"] for child in node.get("children", [])]
    assert len(parents) == len(set(parents)), "a node has two parents"
    assert not set(parents) & set(doc["scenes"][doc["scene"]]["nodes"]), "scene nodes are roots"
    assert set(parents) | set(doc["scenes"][doc["scene"]]["nodes"]) == set(range(len(doc["nodes"])))
    for node in doc["nodes"]:
        assert ("skin" not in node) or ("mesh" in node)


def check_skin(glb, skin):
    assert glb.doc["accessors"][skin["inverseBindMatrices"]]["count"] == len(skin["joints"])
    matrices = glb.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4)
    np.testing.assert_array_equal(matrices[:, :, 3], np.tile([0, 0, 0, 1], (len(matrices), 1)))  # columns are stored


def check_animation(glb, animation):
    targets = [(channel["target"]["node"], channel["target"]["path"]) for channel in animation["channels"]]
    assert len(targets) == len(set(targets))
    for channel in animation["channels"]:
        sampler = animation["samplers"][channel["sampler"]]
        times, values = glb.array(sampler["input"]), glb.array(sampler["output"])
        assert {"min", "max"} <= set(glb.doc["accessors"][sampler["input"]])
        assert times[0, 0] >= 0
        assert (np.diff(times[:, 0]) > 0).all(), "times increase strictly"
        node, path = channel["target"]["node"], channel["target"]["path"]
        if path == "weights":
            targets = glb.doc["meshes"][glb.doc["nodes"][node]["mesh"]]["primitives"][0]["targets"]
            assert glb.doc["accessors"][sampler["output"]]["type"] == "SCALAR"
            assert len(values) == len(times) * len(targets)
        else:
            assert len(values) == len(times)
            assert values.shape[1] == {"rotation": 4, "translation": 3}[path]
        if path == "rotation":
            np.testing.assert_allclose(np.linalg.norm(values, axis=1), 1, atol=1e-5)
        assert "matrix" not in glb.doc["nodes"][node]


def assert_no_empty_values(value):
    """The schema allows neither null nor empty arrays and objects where these are written."""
    if isinstance(value, dict):
        for name, item in value.items():
            assert item is not None, name
            assert item != [], name
            assert_no_empty_values(item)
    elif isinstance(value, list):
        for item in value:
            assert_no_empty_values(item)
