"""What a glTF file shows at rest: meshes with morph targets where their nodes put them, and the colour of their skin."""

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib as gl
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from facesynth.face.files.gltf.document import Buffers, in_one_line, read_document
from facesynth.face.files.gltf.morphs import expressions, names_twice, target_names
from facesynth.inference.errors import FacesynthError

MODES = (None, gl.TRIANGLES, gl.TRIANGLE_STRIP, gl.TRIANGLE_FAN)
BACKWARDS = np.diag([-1.0, 1.0, -1.0, 1.0])
"""VRM 0.x avatars look along -z; glTF's and ours along +z."""


@dataclass(frozen=True, eq=False)
class Part:
    """One primitive of a mesh, placed in the scene at rest."""

    node: int
    name: str
    """Of its node, else of its mesh."""
    vertices: NDArray[np.float64]
    """[V, 3] in the file's unit."""
    triangles: NDArray[np.int64]
    """[F, 3] counter-clockwise seen from outside."""
    targets: dict[str, NDArray[np.float64]]
    """[V, 3] displacement at weight 1, by name."""
    follows: NDArray[np.float64]
    """[V, nodes] share with which each vertex follows each node."""
    colours: NDArray[np.float64]
    """[F, P, P, 3] linear albedo on P points along a triangle's sides, as `_patch_places` lays them."""


@dataclass(frozen=True, eq=False)
class Scene:
    """What a file shows at rest."""

    parts: tuple[Part, ...]
    names: tuple[str, ...]
    """Of the nodes."""
    parents: tuple[int, ...]
    """Of the nodes; -1 for roots."""
    places: NDArray[np.float64]
    """[nodes, 4, 4] from each node to the world."""
    root: NDArray[np.float64]
    """[4, 4] over all nodes: it turns an avatar that looks backwards."""
    head: int | None = None
    """The node that the file itself says is the head."""
    remarks: tuple[str, ...] = ()
    """What is drawn otherwise than the file says, for a person."""
    expressions: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    """Of an avatar: the share of each morph target in each of its expressions, by name."""

    def below(self, node: int) -> NDArray[np.int64]:
        """The node and all nodes under it."""
        found = [node]
        for candidate in range(len(self.parents)):
            place, steps = candidate, 0
            while place not in (-1, node) and steps <= len(self.parents):
                place, steps = self.parents[place], steps + 1
            if place == node and candidate != node:
                found.append(candidate)
        return np.array(found)


def read_scene(path: Path, texels: int) -> Scene:
    """All triangles of a file with their morph targets; texels: points along a triangle's side at which colours are taken."""
    document = read_document(path)
    try:
        return _scene(document, Buffers(document, path), texels)
    except FacesynthError:
        raise
    except (AttributeError, IndexError, KeyError, TypeError, ValueError, ZeroDivisionError, MemoryError, RecursionError) as error:
        raise FacesynthError(f"{path} breaks the rules of glTF ({in_one_line(error)}); export it again") from None


def _scene(document: gl.GLTF2, buffers: Buffers, texels: int) -> Scene:
    count = len(document.nodes)
    parents = [-1] * count
    for index, node in enumerate(document.nodes):
        for child in node.children or []:
            parents[child] = index
    root = BACKWARDS if "VRM" in (document.extensions or {}) else np.eye(4)
    places = root @ _places([_matrix(node) for node in document.nodes], parents)
    shown = _shown(document)
    names = tuple(str(node.name or "") for node in document.nodes)
    parts = [
        _part(document, buffers, index, primitive, places, texels)
        for index, node in enumerate(document.nodes)
        if node.mesh is not None and index in shown
        for primitive in document.meshes[node.mesh].primitives
        if primitive.mode in MODES
    ]
    if not parts:
        raise FacesynthError(f"{buffers.path} shows no triangles; export the head as a mesh")
    remarks = _remarks(document, buffers, shown)
    return Scene(tuple(parts), names, tuple(parents), places, root, _head(document), remarks, expressions(document))


def _shown(document: gl.GLTF2) -> set[int]:
    """The nodes of the scene that is shown, or of the first that shows a mesh; all of them where there is none."""
    if not document.scenes:
        return set(range(len(document.nodes)))
    first = document.scene or 0
    reached = (_reached(document, document.scenes[number].nodes or []) for number in (first, *range(len(document.scenes))))
    shown = next((nodes for nodes in reached if any(document.nodes[node].mesh is not None for node in nodes)), None)
    return set(range(len(document.nodes))) if shown is None else shown


def _reached(document: gl.GLTF2, roots: Sequence[int]) -> set[int]:
    found, waiting = set[int](), list(roots)
    while waiting:
        node = waiting.pop()
        if node not in found:
            found.add(node)
            waiting += document.nodes[node].children or []
    return found


def _head(document: gl.GLTF2) -> int | None:
    """The node of the head of a VRM avatar."""
    extensions = document.extensions or {}
    bones = ((extensions.get("VRM") or {}).get("humanoid") or {}).get("humanBones") or []
    newer = ((extensions.get("VRMC_vrm") or {}).get("humanoid") or {}).get("humanBones") or {}
    older = next((bone.get("node") for bone in bones if bone.get("bone") == "head"), None)
    node = older if older is not None else (newer.get("head") or {}).get("node")
    return node if type(node) is int and 0 <= node < len(document.nodes) else None


def _remarks(document: gl.GLTF2, buffers: Buffers, shown: set[int]) -> tuple[str, ...]:
    """What of a file is drawn otherwise than it says, or not at all."""
    hidden = [node.name or f"node {k}" for k, node in enumerate(document.nodes) if node.mesh is not None and k not in shown]
    twice = [name for mesh in range(len(document.meshes)) for name in names_twice(document, mesh)]
    remarks = []
    if hidden:
        remarks.append(f"{', '.join(hidden[:4])} stand outside of the scene and are not drawn")
    if twice:
        remarks.append(f"several shapes are called {', '.join(dict.fromkeys(twice))}; the first of each is used")
    surfaces = [surface for material in document.materials or [] if (surface := material.pbrMetallicRoughness) is not None]
    used = {surface.baseColorTexture.index for surface in surfaces if surface.baseColorTexture is not None}
    if any(_picture(document, buffers, number) is None for number in sorted(used)):
        remarks.append(
            "textures that are missing or of a kind that is not read (such as KTX2) are drawn in the materials' base colours"
        )
    return tuple(remarks)


def _image(document: gl.GLTF2, texture: int) -> gl.Image | None:
    """The picture of a texture, PNG or JPEG first, else WebP; None where there is none of a usual kind."""
    found = document.textures[texture]
    webp = ((found.extensions or {}).get("EXT_texture_webp") or {}).get("source")
    source = found.source if found.source is not None else webp
    return None if source is None else document.images[source]


def _corners(mode: int | None, corners: NDArray[np.int64]) -> NDArray[np.int64]:
    """[F, 3] triangles of a list, of a strip (every other one is turned round) or of a fan."""
    if mode == gl.TRIANGLE_STRIP and len(corners) >= 3:
        triangles = np.stack([corners[:-2], corners[1:-1], corners[2:]], axis=1)
        triangles[1::2] = triangles[1::2, ::-1]
    elif mode == gl.TRIANGLE_FAN and len(corners) >= 3:
        triangles = np.stack([np.broadcast_to(corners[0], len(corners) - 2), corners[1:-1], corners[2:]], axis=1)
    else:
        return corners[: len(corners) // 3 * 3].reshape(-1, 3)
    a, b, c = triangles.T
    return triangles[(a != b) & (b != c) & (a != c)]


def _places(local: list[NDArray[np.float64]], parents: list[int]) -> NDArray[np.float64]:
    def place(index: int, depth: int = 0) -> NDArray[np.float64]:
        if depth > len(parents):
            raise FacesynthError("the nodes of the file go round in a circle; export it again")
        return local[index] if parents[index] < 0 else place(parents[index], depth + 1) @ local[index]

    return np.stack([place(index) for index in range(len(local))])


def _matrix(node: gl.Node) -> NDArray[np.float64]:
    if node.matrix is not None:
        return np.array(node.matrix, np.float64).reshape(4, 4).T
    matrix = np.eye(4)
    turn = Rotation.from_quat(node.rotation or [0, 0, 0, 1]).as_matrix()
    matrix[:3, :3] = turn * np.asarray(node.scale or [1, 1, 1], np.float64)
    matrix[:3, 3] = node.translation or [0, 0, 0]
    return matrix


def _part(
    document: gl.GLTF2, buffers: Buffers, index: int, primitive: gl.Primitive, places: NDArray[np.float64], texels: int
) -> Part:
    node = document.nodes[index]
    mesh = document.meshes[node.mesh]
    vertices = buffers.array(primitive.attributes.POSITION)
    corners = np.arange(len(vertices)) if primitive.indices is None else buffers.array(primitive.indices)[:, 0].astype(np.int64)
    triangles = _corners(primitive.mode, corners)
    if _is_gauze(document, primitive):
        triangles = triangles[:0]
    if triangles.min(initial=0) < 0 or triangles.max(initial=0) >= len(vertices):
        raise FacesynthError(f"{buffers.path}: a triangle names a vertex that does not exist; export it again")
    follows, turns = _follows(document, buffers, index, primitive, places, len(vertices))
    if np.linalg.det(turns[0, :3, :3]) < 0:
        triangles = triangles[:, ::-1]  # a mirrored node turns its triangles inside out
    world = np.einsum("vij,vj->vi", turns[:, :3, :3], vertices) + turns[:, :3, 3]
    targets = {
        name: np.einsum("vij,vj->vi", turns[:, :3, :3], moved)
        for name, moved in zip(target_names(document, node.mesh), _targets(buffers, primitive, len(vertices)), strict=False)
    }
    colours = _colours(document, buffers, primitive, triangles, texels)
    return Part(index, str(node.name or mesh.name or ""), world, triangles, targets, follows, colours)


def _targets(buffers: Buffers, primitive: gl.Primitive, count: int) -> list[NDArray[np.float64]]:
    targets = []
    for target in primitive.targets or []:
        position = target.get("POSITION") if isinstance(target, dict) else target.POSITION
        moved = np.zeros((count, 3)) if position is None else buffers.array(position)
        if moved.shape != (count, 3):
            raise FacesynthError(f"{buffers.path}: a morph target has {len(moved)} points, its mesh {count}; export it again")
        targets.append(moved)
    return targets


def _follows(
    document: gl.GLTF2, buffers: Buffers, index: int, primitive: gl.Primitive, places: NDArray[np.float64], count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Shares [V, nodes] with which vertices follow nodes, and the matrices [V, 4, 4] that place them at rest."""
    follows = np.zeros((count, len(places)))
    node = document.nodes[index]
    if node.skin is None or primitive.attributes.JOINTS_0 is None:
        follows[:, index] = 1.0
        return follows, np.broadcast_to(places[index], (count, 4, 4))
    skin = document.skins[node.skin]
    joints = np.array(skin.joints)[buffers.array(primitive.attributes.JOINTS_0).astype(np.int64)]
    weights = buffers.array(primitive.attributes.WEIGHTS_0)
    weights = weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-9)
    np.add.at(follows, (np.arange(count)[:, None], joints), weights)
    binds = np.tile(np.eye(4), (len(skin.joints), 1, 1))
    if skin.inverseBindMatrices is not None:
        binds = buffers.array(skin.inverseBindMatrices).reshape(-1, 4, 4).transpose(0, 2, 1)
    at_rest = np.zeros((len(places), 4, 4))
    at_rest[skin.joints] = places[skin.joints] @ binds[: len(skin.joints)]
    return follows, np.einsum("vn,nij->vij", follows, at_rest)


# A triangle is drawn as a quad that repeats its last corner, with places (s, t), 0 <= t <= s <= 1, where corner b weighs s - t
# and corner c weighs t.
def _patch_places(texels: int) -> NDArray[np.float64]:
    """[P, P, 3] weights of a triangle's corners at the points of its patch of colours."""
    s, t = np.meshgrid(np.linspace(0, 1, texels), np.linspace(0, 1, texels), indexing="ij")
    t = np.minimum(s, t)
    return np.stack([1 - s, s - t, t], axis=-1)


def _colours(
    document: gl.GLTF2, buffers: Buffers, primitive: gl.Primitive, triangles: NDArray[np.int64], texels: int
) -> NDArray[np.float64]:
    factor, picture, channel = np.array([0.6, 0.6, 0.6]), None, 0
    moved: Mapping[str, Any] = {}
    if primitive.material is not None:
        surface = document.materials[primitive.material].pbrMetallicRoughness
        if surface is not None:
            factor = np.asarray(surface.baseColorFactor or [1, 1, 1, 1], np.float64)[:3]
            if surface.baseColorTexture is not None:
                picture = _picture(document, buffers, surface.baseColorTexture.index)
                moved = (surface.baseColorTexture.extensions or {}).get("KHR_texture_transform") or {}
                channel = moved.get("texCoord", surface.baseColorTexture.texCoord) or 0
    flat = np.broadcast_to(factor, (len(triangles), texels, texels, 3))
    at = getattr(primitive.attributes, f"TEXCOORD_{channel}", None)
    if picture is None or at is None:
        return np.array(flat)
    places = _moved_uv(buffers.array(at), moved)
    uv = np.einsum("pqc,fcd->fpqd", _patch_places(texels), places[triangles])
    height, width = picture.shape[:2]
    column = np.floor(uv[..., 0] % 1.0 * width).astype(np.int64).clip(0, width - 1)
    row = np.floor(uv[..., 1] % 1.0 * height).astype(np.int64).clip(0, height - 1)
    return flat * (picture[row, column] / 255.0) ** 2.2


def _moved_uv(uv: NDArray[np.float64], moved: Mapping[str, Any]) -> NDArray[np.float64]:
    """[V, 2] places in a picture after KHR_texture_transform: scaled, turned, shifted."""
    angle = float(moved.get("rotation", 0.0))
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    scale, offset = (np.asarray(moved.get(key, usual), np.float64) for key, usual in (("scale", (1, 1)), ("offset", (0, 0))))
    found: NDArray[np.float64] = uv * scale @ turn.T + offset
    return found


def _is_gauze(document: gl.GLTF2, primitive: gl.Primitive) -> bool:
    """Whether one sees through a primitive more than one sees it: drawn solid, lashes would be black bars."""
    if primitive.material is None or document.materials[primitive.material].alphaMode != gl.BLEND:
        return False
    surface = document.materials[primitive.material].pbrMetallicRoughness
    return surface is not None and (surface.baseColorFactor or [1, 1, 1, 1])[3] < 0.5


def _picture(document: gl.GLTF2, buffers: Buffers, texture: int) -> NDArray[np.uint8] | None:
    """[H, W, 3] a picture inside the file or beside it; None for one that is not there or of a kind that is not known."""
    from PIL import Image

    image = _image(document, texture)
    if image is None:
        return None
    try:
        content = buffers.bytes_of(image.bufferView) if image.bufferView is not None else buffers.from_uri(image.uri or "")
    except FacesynthError:
        return None
    try:
        with Image.open(io.BytesIO(content)) as opened:
            opened.thumbnail((4096, 4096))
            return np.asarray(opened.convert("RGB"))
    except (OSError, ValueError, Image.DecompressionBombError):
        return None
