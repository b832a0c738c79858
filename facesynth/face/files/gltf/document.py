"""glTF 2.0 documents that others wrote: taken apart, with the arrays behind their accessors."""

from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import pygltflib as gl
from numpy.typing import NDArray

from facesynth.inference.errors import FacesynthError

LARGEST_BYTES = 2**30
MOST_VALUES = 4 * 10**8
"""Numbers in one accessor; more than any head has."""
_DTYPES = {5120: np.int8, 5121: np.uint8, 5122: np.int16, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_COMPRESSED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression")


def read_document(path: Path) -> gl.GLTF2:
    """A glTF file, taken apart, binary (.glb, .vrm) or JSON as its first bytes say; FacesynthError for anything else."""
    if not path.is_file() or not 0 < path.stat().st_size <= LARGEST_BYTES:
        raise FacesynthError(f"{path} is missing, empty or larger than {LARGEST_BYTES >> 30} GB; export the head as .glb")
    try:
        document = gl.GLTF2().load_binary(str(path)) if is_binary(path) else gl.GLTF2().load_json(str(path))
    except Exception as error:  # the library raises anything on damaged files
        raise FacesynthError(f"{path} is no glTF 2.0 file, or is damaged ({in_one_line(error)}); export it again") from None
    if document is None or not document.meshes or not document.nodes:
        raise FacesynthError(f"{path} holds no mesh; export the head as .glb, with its shape keys")
    for extension in _COMPRESSED:
        if extension in (document.extensionsRequired or []) or _stand_only_in(extension, document):
            raise FacesynthError(
                f"{path} is compressed ({extension}); export it without compression, or take that off:"
                " npx @gltf-transform/cli copy compressed.glb plain.glb"
            )
    return document


def _stand_only_in(extension: str, document: gl.GLTF2) -> bool:
    """Whether points of a mesh stand in an extension alone, although the file does not require it."""
    primitives = [
        primitive for mesh in document.meshes for primitive in mesh.primitives if extension in (primitive.extensions or {})
    ]
    places = [primitive.attributes.POSITION for primitive in primitives]
    return any(isinstance(k, int) and document.accessors[k].bufferView is None for k in places)


def is_binary(path: Path) -> bool:
    """Whether a file begins as a binary glTF does, whatever it is called."""
    with path.open("rb") as file:
        return file.read(4) == b"glTF"


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
        name = Path(unquote(uri))
        beside = self.path.parent / name
        if not name.name or name.is_absolute() or ".." in name.parts or not beside.is_file():
            raise FacesynthError(f"{self.path} needs {uri!r} beside it; export everything into one .glb")
        return beside.read_bytes()


def in_one_line(error: BaseException) -> str:
    """What an error says, on one line of at most 200 characters."""
    return " ".join(str(error).split())[:200]
