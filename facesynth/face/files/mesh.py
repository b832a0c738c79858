"""The rig as the triangle mesh that file formats want: one texture coordinate and one normal per vertex."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facesynth.face.rig.anny import PARTS
from facesynth.face.rig.arkit_rig import Rig


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Vertices split where the texture map has a seam."""

    source: NDArray[np.int64]
    """[V'] vertex of the rig that each came from."""
    uv: NDArray[np.float32]
    """[V', 2] texture coordinates, v upwards."""
    triangles: dict[str, NDArray[np.int64]]
    """[F, 3] by part of the rig, counter-clockwise seen from outside."""

    @classmethod
    def of(cls, rig: Rig, parts: tuple[str, ...]) -> TriangleMesh:
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
        """[V', 3] unit normals of rig vertices [V, 3], averaged over the faces by area; smooth over seams."""
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
