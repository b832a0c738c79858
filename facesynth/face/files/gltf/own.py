"""A head of one's own as glTF: its own file with the animation in it, or a new file for a set of OBJ files."""

import numpy as np
import pygltflib as gl
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from facesynth.face.animation import FaceAnimation
from facesynth.face.files.gltf.buffer import Buffer
from facesynth.face.files.gltf.document import Buffers, read_document
from facesynth.face.files.gltf.mesh import M_PER_MM, TriangleMesh, add_mesh, add_targets
from facesynth.face.files.gltf.morphs import target_names
from facesynth.face.files.gltf.scene import Scene, read_scene
from facesynth.face.files.gltf.tracks import (
    Track,
    eye_turns,
    head_turns,
    rotation_track,
    speech_animation,
    translation_track,
    weights_track,
)
from facesynth.face.rig.own_head import OwnHead

PIVOT, BACK = "facesynth_head", "facesynth_head_origin"
"""Nodes that are put over everything where the file has none that turns with the head."""
_NO_TEXELS = 2
"""The scene is read for the places of its nodes; colours are not needed."""


def animated_document(animation: FaceAnimation, head: OwnHead) -> tuple[gl.GLTF2, Buffer]:
    """The head's own file, whatever is in it, with one more animation; its buffers become one."""
    document = read_document(head.source)
    buffer = _continued(document, head)
    tracks = []
    for index, node in enumerate(document.nodes):
        names = () if node.mesh is None else target_names(document, node.mesh)
        if names:
            tracks.append(weights_track(index, animation.weights_for(names)))
            node.weights = None
    scene = read_scene(head.source, _NO_TEXELS)
    tracks += _head_tracks(document, animation, head, scene) + _eye_tracks(document, animation, head, scene)
    tracks += _joint_tracks(document, animation, head, scene)
    document.animations = [*(document.animations or []), speech_animation(buffer, animation, tracks)]
    return document, buffer


def _continued(document: gl.GLTF2, head: OwnHead) -> Buffer:
    """A buffer that begins with all buffers of the document, one after the other."""
    buffer, old = Buffer(), Buffers(document, head.source)
    starts = []
    for index in range(len(document.buffers)):
        buffer.data.extend(b"\0" * (-len(buffer.data) % 4))
        starts.append(len(buffer.data))
        buffer.data.extend(old.blob(index))
    for view in document.bufferViews:
        view.byteOffset = (view.byteOffset or 0) + starts[view.buffer]
        view.buffer = 0
    buffer.accessors, buffer.views = list(document.accessors), list(document.bufferViews)
    return buffer


# A node under parents P turns by R in the world when its own rotation L becomes P⁻¹ R P L.
def _head_tracks(document: gl.GLTF2, animation: FaceAnimation, head: OwnHead, scene: Scene) -> list[Track]:
    """Rotation and translation of the node that turns with the head; a new one over everything where there is none."""
    turn, shift = head_turns(animation), animation.head[:, 3:].astype(np.float64) / head.mm_per_unit
    if head.head_node is None:
        node = _new_root(document, head, scene)
        place = np.asarray(document.nodes[node].translation) + shift @ scene.root[:3, :3]
        return [rotation_track(node, _within(scene.root, turn)), translation_track(node, place)]
    node, parent = head.head_node, _parent_place(scene, head.head_node)
    rest = _as_trs(document.nodes[node])
    place = np.asarray(rest.translation) + shift @ np.linalg.inv(parent[:3, :3]).T
    own_turn = _within(parent, turn) * Rotation.from_quat(rest.rotation)
    return [rotation_track(node, own_turn), translation_track(node, place)]


def _eye_tracks(document: gl.GLTF2, animation: FaceAnimation, head: OwnHead, scene: Scene) -> list[Track]:
    """Rotation about its centre, and the translation that this takes, of each eyeball's node."""
    look, tracks = eye_turns(animation), []
    for eye, (_, centre_mm) in zip(head.eye_nodes, head.eyes, strict=True):
        centre = centre_mm / head.mm_per_unit + head.middle
        parent, rest = _parent_place(scene, eye), _as_trs(document.nodes[eye])
        origin = centre + look.apply(scene.places[eye][:3, 3] - centre)
        tracks.append(rotation_track(eye, _within(parent, look) * Rotation.from_quat(rest.rotation)))
        tracks.append(translation_track(eye, (origin - parent[:3, 3]) @ np.linalg.inv(parent[:3, :3]).T))
    return tracks


def _joint_tracks(document: gl.GLTF2, animation: FaceAnimation, head: OwnHead, scene: Scene) -> list[Track]:
    """Rotation of each node that a channel turns."""
    tracks = []
    for joint in head.joints:
        amounts = animation.weights_for((head.names[joint.channel],)).astype(np.float64)
        rest = _as_trs(document.nodes[joint.node])
        turn = _within(_parent_place(scene, joint.node), Rotation.from_rotvec(amounts * joint.turn))
        tracks.append(rotation_track(joint.node, turn * Rotation.from_quat(rest.rotation)))
    return tracks


def _parent_place(scene: Scene, node: int) -> NDArray[np.float64]:
    return scene.places[scene.parents[node]] if scene.parents[node] >= 0 else scene.root


def _within(parent: NDArray[np.float64], turn: Rotation) -> Rotation:
    """A turn in the world as it is said under a parent."""
    frame = Rotation.from_matrix(_orthonormal(parent[:3, :3]))
    return frame.inv() * turn * frame


def _orthonormal(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    U, _, Vt = np.linalg.svd(matrix)
    return U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt


def _as_trs(node: gl.Node) -> gl.Node:
    """The node with its place as translation, rotation and scale: animated nodes must not have a matrix."""
    if node.matrix is not None:
        matrix = np.array(node.matrix, np.float64).reshape(4, 4).T
        scale = np.linalg.norm(matrix[:3, :3], axis=0)
        node.translation, node.scale = matrix[:3, 3].tolist(), scale.tolist()
        node.rotation = Rotation.from_matrix(_orthonormal(matrix[:3, :3] / scale)).as_quat().tolist()
        node.matrix = None
    node.rotation = node.rotation or [0.0, 0.0, 0.0, 1.0]
    node.translation = node.translation or [0.0, 0.0, 0.0]
    return node


def _new_root(document: gl.GLTF2, head: OwnHead, scene_at_rest: Scene) -> int:
    """Two nodes over the scene: one at the pivot, which turns, and one that puts the scene back to where it was."""
    pivot = (scene_at_rest.root[:3, :3].T @ (head.pivot_mm / head.mm_per_unit + head.middle)).tolist()
    scene = document.scenes[document.scene or 0]
    index = len(document.nodes)
    document.nodes += [
        gl.Node(name=PIVOT, translation=pivot, children=[index + 1]),
        gl.Node(name=BACK, translation=[-value for value in pivot], children=list(scene.nodes)),
    ]
    scene.nodes = [index]
    return index


def obj_document(animation: FaceAnimation, head: OwnHead) -> tuple[gl.GLTF2, Buffer]:
    """A new file for a head that came as OBJ files: one mesh in one node, in metres, which turns about the pivot."""
    buffer = Buffer()
    mesh = TriangleMesh(np.arange(len(head.rest_mm)), None, {"skin": head.triangles.astype(np.int64)})
    rest_mm = head.rest_mm - head.pivot_mm
    attributes, targets = add_mesh(buffer, mesh, rest_mm), add_targets(buffer, mesh, rest_mm, head.shapes_mm)
    indices = buffer.add(head.triangles.astype(np.uint32).ravel(), gl.ELEMENT_ARRAY_BUFFER)
    primitive = gl.Primitive(attributes=attributes, indices=indices, material=0, targets=targets)
    colour = [float(value) for value in head.colours[0, 0, 0]]
    surface = gl.PbrMetallicRoughness(baseColorFactor=[*colour, 1.0], metallicFactor=0.0, roughnessFactor=0.55)
    extras = {"targetNames": list(head.names)}
    document = gl.GLTF2(
        asset=gl.Asset(version="2.0", generator="facesynth"),
        scene=0,
        scenes=[gl.Scene(nodes=[0])],
        nodes=[gl.Node(name="head", mesh=0, translation=(head.pivot_mm * M_PER_MM).tolist())],
        meshes=[gl.Mesh(name="face", primitives=[primitive], weights=[0.0] * len(head.names), extras=extras)],
        materials=[gl.Material(name="skin", pbrMetallicRoughness=surface, alphaCutoff=None)],
    )
    place = (head.pivot_mm + animation.head[:, 3:]) * M_PER_MM
    tracks = [weights_track(0, animation.weights), rotation_track(0, head_turns(animation)), translation_track(0, place)]
    document.animations = [speech_animation(buffer, animation, tracks)]
    return document, buffer
