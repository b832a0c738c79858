"""Reading glTF 2.0 that others wrote: meshes with morph targets where their nodes put them, and the colour of their skin."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib as gl
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from facesynth.inference.errors import FacesynthError

LARGEST_BYTES = 2**30
MOST_VALUES = 4 * 10**8
"""Numbers in one accessor; more than any head has."""
_DTYPES = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_COMPRESSED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression")


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


def read_document(path: Path) -> gl.GLTF2:
    """A .glb or .gltf file, taken apart; FacesynthError for anything else."""
    if not path.is_file() or not 0 < path.stat().st_size <= LARGEST_BYTES:
        raise FacesynthError(f"{path} is missing, empty or larger than {LARGEST_BYTES >> 30} GB; export the head as .glb")
    try:
        document = gl.GLTF2().load_binary(str(path)) if path.suffix.lower() == ".glb" else gl.GLTF2().load_json(str(path))
    except Exception as error:  # the library raises anything on damaged files
        raise FacesynthError(f"{path} is no glTF 2.0 file, or is damaged ({_line(error)}); export it again") from None
    if document is None or not document.meshes or not document.nodes:
        raise FacesynthError(f"{path} holds no mesh; export the head as .glb, with its shape keys")
    for extension in _COMPRESSED:
        if extension in (document.extensionsRequired or []):
            raise FacesynthError(f"{path} is compressed ({extension}); export it without compression")
    return document


def read_scene(path: Path, texels: int) -> Scene:
    """All triangles of a file with their morph targets; texels: points along a triangle's side at which colours are taken."""
    document = read_document(path)
    try:
        return _scene(document, Buffers(document, path), texels)
    except FacesynthError:
        raise
    except (AttributeError, IndexError, KeyError, TypeError, ValueError, ZeroDivisionError, MemoryError, RecursionError) as error:
        raise FacesynthError(f"{path} breaks the rules of glTF ({_line(error)}); export it again") from None


class Buffers:
    """The arrays behind a document's accessors."""

    def __init__(self, document: gl.GLTF2, path: Path) -> None:
        self.document, self.path = document, path
        self._blobs: dict[int, bytes] = {}

    def array(self, index: int) -> NDArray[np.float64]:
        """[count, width] an accessor's values, normalised integers as fractions."""
        accessor = self.document.accessors[index]
        dtype, width = np.dtype(_DTYPES[accessor.componentType]), _WIDTHS[accessor.type]
        if not 0 < accessor.count <= MOST_VALUES // width:
            raise FacesynthError(f"{self.path} states an array of {accessor.count} values; is it damaged?")
        if accessor.bufferView is None:
            values = np.zeros((accessor.count, width))
        else:
            values = self._view(accessor.bufferView, accessor.byteOffset or 0, accessor.count, dtype, width)
        if accessor.sparse is not None:
            sparse = accessor.sparse
            kind = np.dtype(_DTYPES[sparse.indices.componentType])
            at = self._view(sparse.indices.bufferView, sparse.indices.byteOffset or 0, sparse.count, kind, 1)
            new = self._view(sparse.values.bufferView, sparse.values.byteOffset or 0, sparse.count, dtype, width)
            values[at[:, 0].astype(np.int64)] = new
        if accessor.normalized and dtype.kind in "iu":
            values = np.maximum(values / float(np.iinfo(dtype.name).max), -1.0)
        if not np.isfinite(values).all():
            raise FacesynthError(f"{self.path} holds values that are not finite; export it again")
        return values

    def bytes_of(self, view: int) -> bytes:
        """The bytes of a buffer view, such as a picture."""
        found = self.document.bufferViews[view]
        start = found.byteOffset or 0
        return self.blob(found.buffer)[start : start + found.byteLength]

    def _view(self, index: int, offset: int, count: int, dtype: np.dtype[Any], width: int) -> NDArray[np.float64]:
        view = self.document.bufferViews[index]
        stride = view.byteStride or dtype.itemsize * width
        start = (view.byteOffset or 0) + offset
        data = np.frombuffer(self.blob(view.buffer), np.uint8)
        if start + (count - 1) * stride + dtype.itemsize * width > len(data) or stride < dtype.itemsize * width or start < 0:
            raise FacesynthError(f"{self.path} is cut off: an array ends beyond the file; copy it again")
        rows = np.lib.stride_tricks.as_strided(data[start:], (count, dtype.itemsize * width), (stride, 1))
        return np.ascontiguousarray(rows).view(dtype.newbyteorder("<")).reshape(count, width).astype(np.float64)

    def blob(self, index: int) -> bytes:
        """All bytes of a buffer."""
        if index not in self._blobs:
            uri = self.document.buffers[index].uri
            blob = self.document.binary_blob() if not uri else self.from_uri(uri)
            if blob is None:
                raise FacesynthError(f"{self.path} lacks its binary part; export it as .glb")
            self._blobs[index] = bytes(blob)
        return self._blobs[index]

    def from_uri(self, uri: str) -> bytes:
        """Bytes written into the document, or of a file beside it."""
        import base64

        if uri.startswith("data:"):
            return base64.b64decode(uri.partition(",")[2])
        beside = self.path.parent / Path(uri).name
        if Path(uri).name != uri or not beside.is_file():
            raise FacesynthError(f"{self.path} needs {uri!r} beside it; export everything into one .glb")
        return beside.read_bytes()


def _scene(document: gl.GLTF2, buffers: Buffers, texels: int) -> Scene:
    count = len(document.nodes)
    parents = [-1] * count
    for index, node in enumerate(document.nodes):
        for child in node.children or []:
            parents[child] = index
    places = _places([_matrix(node) for node in document.nodes], parents)
    names = tuple(str(node.name or "") for node in document.nodes)
    parts = [
        _part(document, buffers, index, primitive, places, texels)
        for index, node in enumerate(document.nodes)
        if node.mesh is not None
        for primitive in document.meshes[node.mesh].primitives
        if primitive.mode in (None, gl.TRIANGLES)
    ]
    if not parts:
        raise FacesynthError(f"{buffers.path} shows no triangles; export the head as a mesh")
    return Scene(tuple(parts), names, tuple(parents), places)


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
    triangles = corners[: len(corners) // 3 * 3].reshape(-1, 3)
    if _is_gauze(document, primitive):
        triangles = triangles[:0]
    if triangles.min(initial=0) < 0 or triangles.max(initial=0) >= len(vertices):
        raise FacesynthError(f"{buffers.path}: a triangle names a vertex that does not exist; export it again")
    follows, turns = _follows(document, buffers, index, primitive, places, len(vertices))
    world = np.einsum("vij,vj->vi", turns[:, :3, :3], vertices) + turns[:, :3, 3]
    targets = {
        name: np.einsum("vij,vj->vi", turns[:, :3, :3], moved)
        for name, moved in zip(target_names(mesh), _targets(buffers, primitive, len(vertices)), strict=False)
    }
    colours = _colours(document, buffers, primitive, triangles, texels)
    return Part(index, str(node.name or mesh.name or ""), world, triangles, targets, follows, colours)


def target_names(mesh: gl.Mesh) -> tuple[str, ...]:
    """Names of a mesh's morph targets, which exporters keep in its extras; numbers where there are none."""
    count = max((len(primitive.targets or []) for primitive in mesh.primitives), default=0)
    given = (mesh.extras or {}).get("targetNames") or []
    return tuple(str(given[k]) if k < len(given) else f"target_{k}" for k in range(count))


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
    if primitive.material is not None:
        surface = document.materials[primitive.material].pbrMetallicRoughness
        if surface is not None:
            factor = np.asarray(surface.baseColorFactor or [1, 1, 1, 1], np.float64)[:3]
            if surface.baseColorTexture is not None:
                picture = _picture(document, buffers, surface.baseColorTexture.index)
                channel = surface.baseColorTexture.texCoord or 0
    flat = np.broadcast_to(factor, (len(triangles), texels, texels, 3))
    at = getattr(primitive.attributes, f"TEXCOORD_{channel}", None)
    if picture is None or at is None:
        return np.array(flat)
    uv = np.einsum("pqc,fcd->fpqd", _patch_places(texels), buffers.array(at)[triangles])
    height, width = picture.shape[:2]
    column = np.floor(uv[..., 0] % 1.0 * width).astype(np.int64).clip(0, width - 1)
    row = np.floor(uv[..., 1] % 1.0 * height).astype(np.int64).clip(0, height - 1)
    return flat * (picture[row, column] / 255.0) ** 2.2


def _is_gauze(document: gl.GLTF2, primitive: gl.Primitive) -> bool:
    """Whether one sees through a primitive more than one sees it: drawn solid, lashes would be black bars."""
    if primitive.material is None or document.materials[primitive.material].alphaMode != gl.BLEND:
        return False
    surface = document.materials[primitive.material].pbrMetallicRoughness
    return surface is not None and (surface.baseColorFactor or [1, 1, 1, 1])[3] < 0.5


def _picture(document: gl.GLTF2, buffers: Buffers, texture: int) -> NDArray[np.uint8] | None:
    """[H, W, 3] a picture inside the file; None for one that is elsewhere or of a kind that is not known."""
    from PIL import Image

    image = document.images[document.textures[texture].source]
    if image.bufferView is None and not (image.uri or "").startswith("data:"):
        return None
    content = buffers.bytes_of(image.bufferView) if image.bufferView is not None else buffers.from_uri(image.uri)
    try:
        with Image.open(io.BytesIO(content)) as opened:
            opened.thumbnail((4096, 4096))
            return np.asarray(opened.convert("RGB"))
    except (OSError, ValueError, Image.DecompressionBombError):
        return None


def _line(error: BaseException) -> str:
    return " ".join(str(error).split())[:200]
