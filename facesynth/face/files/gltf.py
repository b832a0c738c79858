"""The head with its 52 shapes and an animation as glTF 2.0, in one binary file."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pygltflib as gl
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from facesynth.atomic import atomic_path
from facesynth.face.animation import FaceAnimation
from facesynth.face.files.gltf_buffer import Buffer
from facesynth.face.files.mesh import TriangleMesh
from facesynth.face.files.skin_picture import skin_jpeg
from facesynth.face.rig.anny import PARTS
from facesynth.face.rig.arkit_rig import PIVOT_MM, Rig

M_PER_MM = 1e-3  # glTF counts in metres
EYES = ("left_eye", "right_eye")
FACE_PARTS = tuple(part for part in PARTS if part not in EYES)
IRIS_MM, PUPIL_MM = 5.9, 2.1

_SKIN, _TEETH, _TONGUE, _LASHES, _EYE = range(5)
_MATERIAL_OF = {"skin": _SKIN, "upper_teeth": _TEETH, "lower_teeth": _TEETH, "tongue": _TONGUE}
_COLOURS = {  # linear base colour, roughness
    "skin": ((1.0, 1.0, 1.0), 0.55),
    "teeth": ((0.78, 0.74, 0.65), 0.3),
    "tongue": ((0.42, 0.13, 0.12), 0.4),
    "lashes": ((0.02, 0.015, 0.012), 0.9),
    "eyes": ((1.0, 1.0, 1.0), 0.12),
}
_TEXTURES = {"eyes": 0, "skin": 1}


def write_glb(path: str | Path, animation: FaceAnimation, rig: Rig) -> None:
    """Write the head, its shapes and the animation.

    Node `face` is the mesh with 52 named morph targets; `head` is the joint that turns it about the top of the
    neck, and shoulders stay with `torso`; `left_eye` and `right_eye` turn in the head. Units are metres.
    """
    buffer = Buffer()
    face, eyes = _face(buffer, rig), [_eye(buffer, rig, side) for side in ("left", "right")]
    document = gl.GLTF2(
        asset=gl.Asset(version="2.0", generator="facesynth"),
        scene=0,
        scenes=[gl.Scene(nodes=[0, 1])],
        nodes=_nodes(rig),
        meshes=[face, *eyes],
        skins=[gl.Skin(joints=[1, 2], skeleton=1, inverseBindMatrices=_inverse_binds(buffer))],
        materials=_materials(),
        animations=[_animation(buffer, animation, rig)],
        images=[
            gl.Image(bufferView=buffer.view(_iris_png()), mimeType="image/png"),
            gl.Image(bufferView=buffer.view(skin_jpeg(rig)), mimeType="image/jpeg"),
        ],
        samplers=[gl.Sampler(magFilter=gl.LINEAR, minFilter=gl.LINEAR, wrapS=gl.CLAMP_TO_EDGE, wrapT=gl.CLAMP_TO_EDGE)],
        textures=[gl.Texture(source=0, sampler=0), gl.Texture(source=1, sampler=0)],
    )
    document.accessors, document.bufferViews = buffer.accessors, buffer.views
    document.buffers = [gl.Buffer(byteLength=len(buffer.data))]
    document.set_binary_blob(bytes(buffer.data))
    with atomic_path(path) as part:
        part.write_bytes(b"".join(document.save_to_bytes()))


def _nodes(rig: Rig) -> list[gl.Node]:
    head = gl.Node(name="head", translation=_metres(PIVOT_MM), children=[3, 4])
    eyes = [
        gl.Node(name=name, mesh=1 + i, translation=_metres(rig.eye_centre_mm(name.removesuffix("_eye")) - PIVOT_MM))
        for i, name in enumerate(EYES)
    ]
    return [gl.Node(name="face", mesh=0, skin=0), gl.Node(name="torso", children=[2]), head, *eyes]


def _face(buffer: Buffer, rig: Rig) -> gl.Mesh:
    """All parts but the eyes: one set of vertices, one primitive per material."""
    mesh = TriangleMesh.of(rig, FACE_PARTS)
    attributes = _attributes(buffer, mesh, rig.rest_mm)
    share = rig.head_weight[mesh.source].astype(np.float32)
    weights = np.stack([1 - share, share, 0 * share, 0 * share], axis=1)
    joints = np.where(weights > 0, np.array([0, 1, 0, 0]), 0).astype(np.uint8)
    attributes.JOINTS_0 = buffer.add(joints, gl.ARRAY_BUFFER)
    attributes.WEIGHTS_0 = buffer.add(weights, gl.ARRAY_BUFFER)
    targets = _targets(buffer, mesh, rig)
    primitives = []
    for material in (_SKIN, _TEETH, _TONGUE, _LASHES):
        parts = [tri for part, tri in mesh.triangles.items() if _MATERIAL_OF.get(part, _LASHES) == material]
        indices = buffer.add(np.concatenate(parts).astype(np.uint32).ravel(), gl.ELEMENT_ARRAY_BUFFER)
        primitives.append(gl.Primitive(attributes=attributes, indices=indices, material=material, targets=targets))
    return gl.Mesh(name="face", primitives=primitives, weights=[0.0] * len(rig.names), extras={"targetNames": list(rig.names)})


def _eye(buffer: Buffer, rig: Rig, side: str) -> gl.Mesh:
    """One eyeball about its own centre; the iris is projected onto it from the front."""
    mesh = TriangleMesh.of(rig, (f"{side}_eye",))
    local_mm = rig.rest_mm - rig.eye_centre_mm(side).astype(np.float32)
    radius_mm = float(np.abs(local_mm[mesh.source, :2]).max())
    uv = (0.5 + local_mm[:, :2] / (2 * radius_mm)).astype(np.float32)
    attributes = _attributes(buffer, TriangleMesh(mesh.source, uv[mesh.source], mesh.triangles), local_mm)
    indices = buffer.add(mesh.all_triangles().astype(np.uint32).ravel(), gl.ELEMENT_ARRAY_BUFFER)
    return gl.Mesh(name=f"{side}_eye", primitives=[gl.Primitive(attributes=attributes, indices=indices, material=_EYE)])


def _attributes(buffer: Buffer, mesh: TriangleMesh, vertices_mm: NDArray[np.float32]) -> gl.Attributes:
    position = (vertices_mm[mesh.source] * M_PER_MM).astype(np.float32)
    uv = np.stack([mesh.uv[:, 0], 1 - mesh.uv[:, 1]], axis=1)  # glTF's v points down
    return gl.Attributes(
        POSITION=buffer.add(position, gl.ARRAY_BUFFER),
        NORMAL=buffer.add(mesh.normals(vertices_mm).astype(np.float32), gl.ARRAY_BUFFER),
        TEXCOORD_0=buffer.add(uv.astype(np.float32), gl.ARRAY_BUFFER),
    )


def _targets(buffer: Buffer, mesh: TriangleMesh, rig: Rig) -> list[gl.Attributes]:
    """Displacements of position and normal for each shape at weight 1; dense, because not every viewer reads sparse."""
    rest = mesh.normals(rig.rest_mm)
    targets = []
    for shape in rig.shapes_mm:
        position = (shape[mesh.source] * M_PER_MM).astype(np.float32)
        normal = (mesh.normals(rig.rest_mm + shape) - rest).astype(np.float32)
        added = [buffer.add(array, gl.ARRAY_BUFFER) for array in (position, normal)]
        targets.append(gl.Attributes(POSITION=added[0], NORMAL=added[1], TEXCOORD_0=None))
    return targets


def _animation(buffer: Buffer, animation: FaceAnimation, rig: Rig) -> gl.Animation:
    times = buffer.add(animation.times_s.astype(np.float32))
    gaze = animation.gaze.astype(np.float64)
    look = Rotation.from_euler("YX", np.stack([gaze[:, 0], -gaze[:, 1]], axis=1))
    turn = Rotation.from_rotvec(animation.head[:, :3].astype(np.float64))
    place = (PIVOT_MM + animation.head[:, 3:]) * M_PER_MM
    tracks = [
        (0, "weights", animation.weights_for(rig.names).ravel()),
        (2, "rotation", _quaternions(turn)),
        (2, "translation", place.astype(np.float32)),
        (3, "rotation", _quaternions(look)),
        (4, "rotation", _quaternions(look)),
    ]
    channels, samplers = [], []
    for index, (node, path, values) in enumerate(tracks):
        samplers.append(gl.AnimationSampler(input=times, output=buffer.add(values), interpolation="LINEAR"))
        channels.append(gl.AnimationChannel(sampler=index, target=gl.AnimationChannelTarget(node=node, path=path)))
    return gl.Animation(name="speech", channels=channels, samplers=samplers, extras={"fps": animation.fps})


def _quaternions(rotations: Rotation) -> NDArray[np.float32]:
    """[T, 4] x, y, z, w, each on the same side as the one before, so that players take the short way."""
    quaternions = rotations.as_quat(canonical=True)
    flips = np.cumprod(np.where((quaternions[1:] * quaternions[:-1]).sum(axis=1) < 0, -1.0, 1.0))
    return (quaternions * np.concatenate([[1.0], flips])[:, None]).astype(np.float32)


def _inverse_binds(buffer: Buffer) -> int:
    matrices = np.tile(np.eye(4, dtype=np.float32), (2, 1, 1))
    matrices[1, :3, 3] = -PIVOT_MM * M_PER_MM
    return buffer.add(matrices)


def _materials() -> list[gl.Material]:
    materials = []
    for name, (colour, roughness) in _COLOURS.items():
        hairs = name == "lashes"  # strips that hairs cover by less than half
        surface = gl.PbrMetallicRoughness(
            baseColorFactor=[*colour, 0.4 if hairs else 1.0], metallicFactor=0.0, roughnessFactor=roughness
        )
        if name in _TEXTURES:
            surface.baseColorTexture = gl.TextureInfo(index=_TEXTURES[name])
        mode = gl.BLEND if hairs else gl.OPAQUE
        materials.append(
            gl.Material(name=name, pbrMetallicRoughness=surface, doubleSided=hairs, alphaMode=mode, alphaCutoff=None)
        )
    return materials


def _iris_png() -> bytes:
    """A front view of the eyeball, 28 mm across: pupil, iris with a dark rim, white that reddens outwards."""
    from PIL import Image

    half = np.linspace(-14.0, 14.0, 512)
    radius = np.hypot(*np.meshgrid(half, half))
    angle = np.arctan2(*np.meshgrid(half, half))
    streaks = 0.85 + 0.15 * np.sin(37 * angle) * np.cos(11 * angle + 2)
    white = np.array([232, 226, 220]) - np.clip(radius - 7, 0, 7)[..., None] * [2.0, 7.0, 7.0]
    iris = (
        np.array([88, 66, 44]) * (streaks * np.interp(radius, [PUPIL_MM, 3.5, 5.0, IRIS_MM], [0.8, 1.25, 1.0, 0.35]))[..., None]
    )
    share = np.clip((IRIS_MM - radius) / 0.35 + 0.5, 0, 1)[..., None]
    dark = np.clip((PUPIL_MM - radius) / 0.2 + 0.5, 0, 1)[..., None]
    picture = (white * (1 - share) + iris * share) * (1 - dark) + 6 * dark
    file = io.BytesIO()
    Image.fromarray(np.clip(picture, 0, 255).astype(np.uint8)).save(file, "PNG")
    return file.getvalue()


def _metres(point_mm: NDArray[np.float64]) -> list[float]:
    return [float(value) for value in np.asarray(point_mm) * M_PER_MM]
