"""Triangle meshes as file formats want them, one texture coordinate and one normal per vertex, and how they go into a buffer."""

from dataclasses import dataclass

import numpy as np
import pygltflib as gl
from numpy.typing import NDArray

from facesynth.face.files.gltf.buffer import Buffer
from facesynth.face.rig.anny import PARTS
from facesynth.face.rig.arkit_rig import Rig

M_PER_MM = 1e-3
"""glTF counts in metres."""


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Vertices split where the texture map has a seam."""

    source: NDArray[np.int64]
    """[V'] vertex of the head that each came from."""
    uv: NDArray[np.float32] | None
    """[V', 2] texture coordinates, v upwards."""
    triangles: dict[str, NDArray[np.int64]]
    """[F, 3] by part of the head, counter-clockwise seen from outside."""

    @classmethod
    def of(cls, rig: Rig, parts: tuple[str, ...]) -> "TriangleMesh":
        """The named parts of a rig."""
        chosen = np.isin(rig.quad_part, [PARTS.index(name) for name in parts])
        quads, part = rig.quads[chosen], rig.quad_part[chosen]
        corners = np.column_stack([quads.reshape(-1, 1), rig.corner_uv[chosen].reshape(-1, 2)])
        split, index = np.unique(corners, axis=0, return_inverse=True)
        index = index.reshape(-1, 4)
        triangles = {name: _triangles(index[part == PARTS.index(name)]) for name in parts}
        return cls(split[:, 0].astype(np.int64), split[:, 1:].astype(np.float32), triangles)

    def all_triangles(self) -> NDArray[np.int64]:
        """[F, 3] of all parts."""
        return np.concatenate(list(self.triangles.values()))

    def normals(self, vertices_mm: NDArray[np.floating]) -> NDArray[np.float64]:
        """[V', 3] unit normals of the head's vertices [V, 3], averaged over the faces by area; smooth over seams."""
        faces = self.source[self.all_triangles()]
        a, b, c = (vertices_mm[faces[:, corner]].astype(np.float64) for corner in range(3))
        area = np.cross(b - a, c - a)
        total = np.stack(
            [np.bincount(faces.ravel(), np.repeat(area[:, axis], 3), minlength=len(vertices_mm)) for axis in range(3)], axis=1
        )
        length = np.linalg.norm(total, axis=1, keepdims=True)
        unit = np.where(length > 1e-12, total / np.maximum(length, 1e-12), [0.0, 0.0, 1.0])
        return unit[self.source]


def _triangles(quads: NDArray[np.int64]) -> NDArray[np.int64]:
    both = np.stack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]], axis=1).reshape(-1, 3)
    return both[(both[:, 0] != both[:, 1]) & (both[:, 1] != both[:, 2]) & (both[:, 2] != both[:, 0])]


def add_mesh(buffer: Buffer, mesh: TriangleMesh, vertices_mm: NDArray[np.floating]) -> gl.Attributes:
    """Positions in metres, normals and texture coordinates of a mesh over vertices [V, 3] in mm."""
    position = buffer.add((vertices_mm[mesh.source] * M_PER_MM).astype(np.float32), gl.ARRAY_BUFFER)
    normal = buffer.add(mesh.normals(vertices_mm).astype(np.float32), gl.ARRAY_BUFFER)
    attributes = gl.Attributes(POSITION=position, NORMAL=normal, TEXCOORD_0=None)
    if mesh.uv is not None:
        uv = np.stack([mesh.uv[:, 0], 1 - mesh.uv[:, 1]], axis=1)  # glTF's v points down
        attributes.TEXCOORD_0 = buffer.add(uv.astype(np.float32), gl.ARRAY_BUFFER)
    return attributes


def add_targets(
    buffer: Buffer, mesh: TriangleMesh, rest_mm: NDArray[np.floating], shapes_mm: NDArray[np.floating]
) -> list[gl.Attributes]:
    """Displacements of position and normal for each of the shapes [N, V, 3]; dense, because not every viewer reads sparse."""
    rest = mesh.normals(rest_mm)
    targets = []
    for shape in shapes_mm:
        position = (shape[mesh.source] * M_PER_MM).astype(np.float32)
        normal = (mesh.normals(rest_mm + shape) - rest).astype(np.float32)
        added = [buffer.add(array, gl.ARRAY_BUFFER) for array in (position, normal)]
        targets.append(gl.Attributes(POSITION=added[0], NORMAL=added[1], TEXCOORD_0=None))
    return targets
