"""What a head of somebody's own writes: its own file with the animation in it, its curves, its arrays."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pygltflib as gl
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from facesynth.atomic import atomic_path
from facesynth.face.draw.raster import vertex_normals
from facesynth.face.files.curves import write_curves
from facesynth.face.files.gltf_buffer import Buffer
from facesynth.face.files.gltf_read import read_document, read_scene, target_names
from facesynth.face.own_animation import OwnAnimation
from facesynth.face.rig.own_head import OwnHead
from facesynth.inference.errors import unknown

SUFFIXES = (".glb", ".csv", ".npz")
M_PER_MM = 1e-3
PIVOT, BACK = "facesynth_head", "facesynth_head_origin"
"""Nodes that are put over everything where the file has none that turns with the head."""


def write_own(path: str | Path, animation: OwnAnimation, head: OwnHead) -> None:
    """Write `.glb` (the head's own file with the animation added), `.csv` (its curves by name) or `.npz`."""
    suffix = Path(path).suffix.lower()
    if suffix == ".csv":
        write_curves(path, animation.names, animation.values, animation.fps)
    elif suffix == ".npz":
        with atomic_path(path) as part, open(part, "wb") as file:
            np.savez_compressed(
                file,
                allow_pickle=False,
                names=np.array(animation.names),
                weights=animation.values.astype(np.float32),
                head=animation.head.astype(np.float32),
                gaze=animation.gaze.astype(np.float32),
                fps=np.array(animation.fps),
            )
    elif suffix == ".glb":
        document, data = _animated(animation, head) if head.source.is_file() else _built(animation, head)
        with atomic_path(path) as part:
            document.buffers = [gl.Buffer(byteLength=len(data))]
            document.set_binary_blob(bytes(data))
            part.write_bytes(b"".join(document.save_to_bytes()))
    else:
        raise unknown("output of an own head", suffix or str(path), SUFFIXES)


def _animated(animation: OwnAnimation, head: OwnHead) -> tuple[gl.GLTF2, bytearray]:
    """The head's own file, whatever is in it, with one more animation; its buffers become one."""
    document = read_document(head.source)
    buffer = _continued(document, head)
    tracks: list[tuple[int, str, NDArray[np.float32]]] = []
    for index, node in enumerate(document.nodes):
        names = () if node.mesh is None else target_names(document.meshes[node.mesh])
        if names:
            columns = [animation.names.index(name) for name in names]
            tracks.append((index, "weights", animation.values[:, columns].astype(np.float32).ravel()))
            node.weights = None
    tracks += _turning(document, animation, head)
    _add_animation(document, buffer, animation, tracks)
    document.accessors, document.bufferViews = buffer.accessors, buffer.views
    return document, buffer.data


def _continued(document: gl.GLTF2, head: OwnHead) -> Buffer:
    """A buffer that begins with all buffers of the document, one after the other."""
    from facesynth.face.files.gltf_read import Buffers

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


def _turning(document: gl.GLTF2, animation: OwnAnimation, head: OwnHead) -> list[tuple[int, str, NDArray[np.float32]]]:
    """Tracks of the node that turns with the head, and of the eyes' nodes.

    A node under parents P turns by R in the world when its own rotation L becomes `P⁻¹ R P L`.
    """
    turn = Rotation.from_rotvec(animation.head[:, :3])
    shift = animation.head[:, 3:] / head.mm_per_unit
    node = head.head_node
    if node is None:
        node = _new_root(document, head)
    scene = read_scene(head.source, 2)
    tracks: list[tuple[int, str, NDArray[np.float32]]] = []
    if node < len(scene.places):
        parent = scene.places[scene.parents[node]] if scene.parents[node] >= 0 else np.eye(4)
        rest = _as_trs(document.nodes[node])
        tracks.append((node, "rotation", _quaternions(_within(parent, turn) * Rotation.from_quat(rest.rotation))))
        place = np.asarray(rest.translation) + shift @ np.linalg.inv(parent[:3, :3]).T
    else:
        tracks.append((node, "rotation", _quaternions(turn)))
        place = np.asarray(document.nodes[node].translation) + shift
    tracks.append((node, "translation", place.astype(np.float32)))
    look = Rotation.from_euler("YX", np.stack([animation.gaze[:, 0], -animation.gaze[:, 1]], axis=1))
    for eye, (_, centre_mm) in zip(head.eye_nodes, head.eyes, strict=True):
        centre = centre_mm / head.mm_per_unit + head.middle
        parent = scene.places[scene.parents[eye]] if scene.parents[eye] >= 0 else np.eye(4)
        rest = _as_trs(document.nodes[eye])
        tracks.append((eye, "rotation", _quaternions(_within(parent, look) * Rotation.from_quat(rest.rotation))))
        origin = centre + look.apply(scene.places[eye][:3, 3] - centre)
        tracks.append((eye, "translation", ((origin - parent[:3, 3]) @ np.linalg.inv(parent[:3, :3]).T).astype(np.float32)))
    return tracks


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


def _new_root(document: gl.GLTF2, head: OwnHead) -> int:
    """Two nodes over the scene: one at the pivot, which turns, and one that puts the scene back to where it was."""
    middle = head.middle
    pivot = (head.pivot_mm / head.mm_per_unit + middle).tolist()
    scene = document.scenes[document.scene or 0]
    index = len(document.nodes)
    document.nodes += [
        gl.Node(name=PIVOT, translation=pivot, children=[index + 1]),
        gl.Node(name=BACK, translation=[-value for value in pivot], children=list(scene.nodes)),
    ]
    scene.nodes = [index]
    return index


def _add_animation(
    document: gl.GLTF2, buffer: Buffer, animation: OwnAnimation, tracks: list[tuple[int, str, NDArray[np.float32]]]
) -> None:
    times = buffer.add(animation.times_s.astype(np.float32))
    channels, samplers = [], []
    for number, (node, path, values) in enumerate(tracks):
        samplers.append(gl.AnimationSampler(input=times, output=buffer.add(values), interpolation="LINEAR"))
        channels.append(gl.AnimationChannel(sampler=number, target=gl.AnimationChannelTarget(node=node, path=path)))
    speech = gl.Animation(name="speech", channels=channels, samplers=samplers, extras={"fps": animation.fps})
    document.animations = [*(document.animations or []), speech]


def _quaternions(rotations: Rotation) -> NDArray[np.float32]:
    quaternions = rotations.as_quat(canonical=True)
    flips = np.cumprod(np.where((quaternions[1:] * quaternions[:-1]).sum(axis=1) < 0, -1.0, 1.0))
    return (quaternions * np.concatenate([[1.0], flips])[:, None]).astype(np.float32)


def _built(animation: OwnAnimation, head: OwnHead) -> tuple[gl.GLTF2, bytearray]:
    """A new file for a head that came as OBJ files: one mesh in one node, in metres, which turns about the pivot."""
    buffer = Buffer()
    rest = ((head.rest_mm - head.pivot_mm) * M_PER_MM).astype(np.float32)
    quads = np.ascontiguousarray(head.triangles[:, [0, 1, 2, 2]], np.int32)
    normals = vertex_normals(head.rest_mm, quads)
    targets = [
        gl.Attributes(
            POSITION=buffer.add((shape * M_PER_MM).astype(np.float32), gl.ARRAY_BUFFER),
            NORMAL=buffer.add((vertex_normals(head.rest_mm + shape, quads) - normals).astype(np.float32), gl.ARRAY_BUFFER),
            TEXCOORD_0=None,
        )
        for shape in head.shapes_mm
    ]
    attributes = gl.Attributes(
        POSITION=buffer.add(rest, gl.ARRAY_BUFFER), NORMAL=buffer.add(normals.astype(np.float32), gl.ARRAY_BUFFER)
    )
    indices = buffer.add(head.triangles.astype(np.uint32).ravel(), gl.ELEMENT_ARRAY_BUFFER)
    primitive = gl.Primitive(attributes=attributes, indices=indices, material=0, targets=targets)
    mesh = gl.Mesh(name="face", primitives=[primitive], weights=[0.0] * len(head.names), extras={"targetNames": list(head.names)})
    colour = [float(value) for value in head.colours[0, 0, 0]]
    surface = gl.PbrMetallicRoughness(baseColorFactor=[*colour, 1.0], metallicFactor=0.0, roughnessFactor=0.55)
    document = gl.GLTF2(
        asset=gl.Asset(version="2.0", generator="facesynth"),
        scene=0,
        scenes=[gl.Scene(nodes=[0])],
        nodes=[gl.Node(name="head", mesh=0, translation=(head.pivot_mm * M_PER_MM).tolist())],
        meshes=[mesh],
        materials=[gl.Material(name="skin", pbrMetallicRoughness=surface, alphaCutoff=None)],
    )
    place = ((head.pivot_mm + animation.head[:, 3:]) * M_PER_MM).astype(np.float32)
    turn = _quaternions(Rotation.from_rotvec(animation.head[:, :3]))
    weights = animation.values.astype(np.float32).ravel()
    _add_animation(document, buffer, animation, [(0, "weights", weights), (0, "rotation", turn), (0, "translation", place)])
    document.accessors, document.bufferViews = buffer.accessors, buffer.views
    return document, buffer.data
