"""The built-in head with its 52 shapes and an animation as a glTF document."""

import io
from functools import lru_cache

import numpy as np
import pygltflib as gl
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from facesynth.face.animation import FaceAnimation
from facesynth.face.draw.albedo import HAIR, brow_shade, spread
from facesynth.face.draw.bake import baked_head, fine_corner_uv
from facesynth.face.files.gltf.buffer import Buffer
from facesynth.face.files.gltf.mesh import M_PER_MM, TriangleMesh, add_mesh, add_targets
from facesynth.face.files.gltf.tracks import (
    Track,
    eye_turns,
    head_turns,
    rotation_track,
    speech_animation,
    translation_track,
    weights_track,
)
from facesynth.face.rig.anny import PARTS
from facesynth.face.rig.arkit_rig import PIVOT_MM, Rig

SIDE = 2048
"""Pixels along the side of the picture."""
_BROW_DENSITY = 0.8  # the strands of the brows are not part of a mesh: their shade is


@lru_cache(maxsize=1)
def skin_jpeg(rig: Rig) -> bytes:
    """The skin in display values, rows from the top of the texture map down; nothing is left bare between its islands."""
    from PIL import Image

    surface = baked_head(rig).surface
    painted = len(surface.texture)
    uv = spread(fine_corner_uv(rig)[:painted].astype(np.float64)).reshape(-1, 2)
    place = spread(surface.rest[surface.quads[:painted]].astype(np.float64)).reshape(-1, 3)
    albedo = (surface.texture[..., :3].reshape(-1, 3) / 255.0) ** 2
    hairy = _BROW_DENSITY * brow_shade(place)[:, None]
    picture = _scattered(uv, albedo * (1 - hairy) + HAIR * hairy)
    file = io.BytesIO()
    Image.fromarray(np.round(255 * _displayed(picture)).astype(np.uint8)).save(file, "JPEG", quality=90)
    return file.getvalue()


def _scattered(uv: NDArray[np.float64], colour: NDArray[np.float64]) -> NDArray[np.float64]:
    """[SIDE, SIDE, 3] means of the colours that fall on each pixel; empty pixels take the nearest one's."""
    column, row = (np.clip(np.stack([uv[:, 0], 1 - uv[:, 1]]), 0, 1 - 1e-9) * SIDE).astype(np.int64)
    pixel = row * SIDE + column
    count = np.bincount(pixel, minlength=SIDE * SIDE)
    total = np.stack([np.bincount(pixel, channel, SIDE * SIDE) for channel in colour.T], axis=1)
    mean = (total / np.maximum(count, 1)[:, None]).reshape(SIDE, SIDE, 3)
    rows, columns = distance_transform_edt(count.reshape(SIDE, SIDE) == 0, return_distances=False, return_indices=True)
    return mean[rows, columns]


def _displayed(linear: NDArray[np.float64]) -> NDArray[np.float64]:
    """The sRGB curve."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)


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


def built_in_document(animation: FaceAnimation, rig: Rig) -> tuple[gl.GLTF2, Buffer]:
    """The head, its shapes and the animation.

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
        animations=[speech_animation(buffer, animation, _tracks(animation, rig))],
        images=[
            gl.Image(bufferView=buffer.view(_iris_png()), mimeType="image/png"),
            gl.Image(bufferView=buffer.view(skin_jpeg(rig)), mimeType="image/jpeg"),
        ],
        samplers=[gl.Sampler(magFilter=gl.LINEAR, minFilter=gl.LINEAR, wrapS=gl.CLAMP_TO_EDGE, wrapT=gl.CLAMP_TO_EDGE)],
        textures=[gl.Texture(source=0, sampler=0), gl.Texture(source=1, sampler=0)],
    )
    return document, buffer


def _tracks(animation: FaceAnimation, rig: Rig) -> list[Track]:
    head, left_eye, right_eye = 2, 3, 4
    look = eye_turns(animation)
    return [
        weights_track(0, animation.weights_for(rig.names)),
        rotation_track(head, head_turns(animation)),
        translation_track(head, (PIVOT_MM + animation.head[:, 3:]) * M_PER_MM),
        rotation_track(left_eye, look),
        rotation_track(right_eye, look),
    ]


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
    attributes = add_mesh(buffer, mesh, rig.rest_mm)
    share = rig.head_weight[mesh.source].astype(np.float32)
    weights = np.stack([1 - share, share, 0 * share, 0 * share], axis=1)
    joints = np.where(weights > 0, np.array([0, 1, 0, 0]), 0).astype(np.uint8)
    attributes.JOINTS_0 = buffer.add(joints, gl.ARRAY_BUFFER)
    attributes.WEIGHTS_0 = buffer.add(weights, gl.ARRAY_BUFFER)
    targets = add_targets(buffer, mesh, rig.rest_mm, rig.shapes_mm)
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
    attributes = add_mesh(buffer, TriangleMesh(mesh.source, uv[mesh.source], mesh.triangles), local_mm)
    indices = buffer.add(mesh.all_triangles().astype(np.uint32).ravel(), gl.ELEMENT_ARRAY_BUFFER)
    return gl.Mesh(name=f"{side}_eye", primitives=[gl.Primitive(attributes=attributes, indices=indices, material=_EYE)])


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
