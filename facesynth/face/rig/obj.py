"""Text files of meshes: Wavefront OBJ with groups, and MakeHuman's sparse `.target` displacement files."""

import gzip
import re
from collections.abc import Container
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.errors import FacesynthError


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


NEUTRAL = re.compile(r"neutral|base|basis|rest", re.IGNORECASE)
"""What the OBJ file without any movement is called, alone or as a part of its name."""
LARGEST_BYTES = 2**28


def read_shapes(
    folder: str | Path,
) -> tuple[tuple[str, ...], NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """A head as OBJ files of the same vertices: `neutral.obj` and one for each shape, called as the shape.

    Returns the names of N shapes, the neutral vertices [V, 3], displacements [N, V, 3] and triangles [F, 3].
    """
    files = sorted(path for path in Path(folder).iterdir() if path.suffix.lower() == ".obj" and not path.name.startswith("."))
    neutral = [path for path in files if NEUTRAL.search(path.stem)]
    if len(neutral) != 1 or len(files) < 2:
        raise FacesynthError(f"{folder} needs one neutral.obj and an OBJ file for each shape; got {len(files)} OBJ files")
    vertices, triangles = read_triangles(neutral[0])
    shapes = [path for path in files if path != neutral[0]]
    moved = np.zeros((len(shapes), *vertices.shape))
    for index, path in enumerate(shapes):
        there, _ = read_triangles(path)
        if there.shape != vertices.shape:
            raise FacesynthError(
                f"{path} has {len(there)} vertices, {neutral[0].name} {len(vertices)}; export both from one mesh"
            )
        moved[index] = there - vertices
    return tuple(path.stem for path in shapes), vertices, moved, triangles


def read_triangles(path: Path) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices [V, 3] and triangles [F, 3] of an OBJ file; faces with more corners are fanned out."""
    vertices: list[list[float]] = []
    triangles: list[tuple[int, int, int]] = []
    try:
        if path.stat().st_size > LARGEST_BYTES:
            raise FacesynthError(f"{path} is larger than {LARGEST_BYTES >> 20} MB; is it one head?")
        for line in path.read_text(encoding="utf-8").splitlines():
            key, *fields = line.split() or [""]
            if key == "v":
                vertices.append([float(x) for x in fields[:3]])
            elif key == "f":
                corner = [int(field.split("/")[0]) for field in fields]
                corner = [index - 1 if index > 0 else len(vertices) + index for index in corner]
                triangles += [(corner[0], corner[k], corner[k + 1]) for k in range(1, len(corner) - 1)]
        points, table = np.array(vertices, np.float64).reshape(-1, 3), np.array(triangles, np.int64).reshape(-1, 3)
    except (OSError, UnicodeDecodeError, ValueError, IndexError) as error:
        raise FacesynthError(f"{path} cannot be read as an OBJ file ({error})") from None
    if not len(table) or not np.isfinite(points).all() or table.min() < 0 or table.max() >= len(points):
        raise FacesynthError(f"{path} holds no faces, or faces of vertices that it does not have; export it again")
    return points, table
