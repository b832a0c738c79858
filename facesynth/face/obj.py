"""Text files of meshes: Wavefront OBJ with groups, and MakeHuman's sparse `.target` displacement files."""

from __future__ import annotations

import gzip
from collections.abc import Container
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.errors import FacesynthError


@dataclass(frozen=True, eq=False)
class ObjMesh:
    """Vertices, texture coordinates and the quads of some groups; a triangle repeats its last corner."""

    vertices: NDArray[np.float64]
    """[N, 3] in the file's unit."""
    uv: NDArray[np.float64]
    """[M, 2] texture coordinates, v upwards."""
    quads: NDArray[np.int64]
    """[Q, 4] vertex of each corner."""
    quad_uv: NDArray[np.int64]
    """[Q, 4] texture coordinate of each corner."""
    quad_group: tuple[str, ...]
    """Q group names."""


def read_obj(path: str | Path, groups: Container[str]) -> ObjMesh:
    """Read an OBJ file whose faces are triangles or quads written `v/vt`, keeping the faces of `groups`."""
    vertices: list[list[float]] = []
    uv: list[list[float]] = []
    corners: list[list[tuple[int, int]]] = []
    names: list[str] = []
    group = ""
    try:
        for line in Path(path).read_text(encoding="utf-8").splitlines():
            key, *fields = line.split() or [""]
            if key == "v":
                vertices.append([float(x) for x in fields[:3]])
            elif key == "vt":
                uv.append([float(x) for x in fields[:2]])
            elif key == "g":
                group = fields[0] if fields else ""
            elif key == "f" and group in groups:
                corners.append(_corners(fields))
                names.append(group)
    except (ValueError, IndexError, UnicodeDecodeError) as error:
        raise FacesynthError(f"{path} is not an OBJ file of quads with texture coordinates ({error})") from None
    if not corners:
        raise FacesynthError(f"{path} holds no faces of the groups that are needed")
    table = np.array(corners) - 1  # OBJ counts from 1
    return ObjMesh(np.array(vertices), np.array(uv), table[..., 0], table[..., 1], tuple(names))


def read_target(path: str | Path, vertex_count: int) -> NDArray[np.float64]:
    """Read a sparse displacement (lines `index dx dy dz`, perhaps gzipped) as [vertex_count, 3]."""
    raw = Path(path).read_bytes()
    text = (gzip.decompress(raw) if raw[:2] == b"\x1f\x8b" else raw).decode("utf-8")
    rows = [line.split()[:4] for line in text.splitlines() if line[:1].isdigit()]
    dense = np.zeros((vertex_count, 3))
    if rows:
        table = np.array(rows, np.float64)
        dense[table[:, 0].astype(np.int64)] = table[:, 1:]
    return dense


def _corners(fields: list[str]) -> list[tuple[int, int]]:
    pairs = [(int(v), int(vt)) for v, vt in (field.split("/")[:2] for field in fields)]
    if len(pairs) not in (3, 4):
        raise ValueError(f"a face with {len(pairs)} corners")
    return pairs if len(pairs) == 4 else [*pairs, pairs[2]]
