"""Arrays laid one after the other in the binary chunk of a .glb, each with the accessor that describes it."""

from typing import Any

import numpy as np
import pygltflib as gl
from numpy.typing import NDArray

_COMPONENTS = {
    np.dtype(np.uint8): gl.UNSIGNED_BYTE,
    np.dtype(np.uint16): gl.UNSIGNED_SHORT,
    np.dtype(np.uint32): gl.UNSIGNED_INT,
    np.dtype(np.float32): gl.FLOAT,
}
_TYPES = {(): gl.SCALAR, (2,): gl.VEC2, (3,): gl.VEC3, (4,): gl.VEC4, (4, 4): gl.MAT4}


class Buffer:
    """Collects arrays; `accessors`, `views` and `data` become the document's."""

    def __init__(self) -> None:
        self.accessors: list[gl.Accessor] = []
        self.views: list[gl.BufferView] = []
        self.data = bytearray()

    def view(self, content: bytes, target: int | None = None) -> int:
        """Append bytes on a boundary of four; returns the index of their buffer view."""
        self.data.extend(b"\0" * (-len(self.data) % 4))
        self.views.append(gl.BufferView(buffer=0, byteOffset=len(self.data), byteLength=len(content), target=target))
        self.data.extend(content)
        return len(self.views) - 1

    def add(self, array: NDArray[Any], target: int | None = None) -> int:
        """Append an array [count, ...]; returns the index of its accessor.

        The bounds that the format asks for (positions, animation times) are given for all of floats. A matrix
        [count, 4, 4] acts on column vectors; the file keeps columns, so it is transposed.
        """
        columns = array.transpose(0, 2, 1) if array.ndim == 3 else array
        flat = columns.reshape(len(array), -1)
        accessor = gl.Accessor(
            bufferView=self.view(np.ascontiguousarray(columns).tobytes(), target),
            componentType=_COMPONENTS[array.dtype],
            count=len(array),
            type=_TYPES[array.shape[1:]],
            min=flat.min(axis=0).tolist() if array.dtype == np.float32 else None,
            max=flat.max(axis=0).tolist() if array.dtype == np.float32 else None,
        )
        self.accessors.append(accessor)
        return len(self.accessors) - 1
