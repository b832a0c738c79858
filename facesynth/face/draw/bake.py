"""The look of the built-in head, worked out once and cached."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from facesynth.atomic import atomic_path
from facesynth.cache import cache_dir
from facesynth.face.draw.albedo import inside_mouth, paint_skin, scalp
from facesynth.face.draw.camera import Camera
from facesynth.face.draw.look import Eyeball, LitSphere, Look
from facesynth.face.draw.occlusion import sky_visibility
from facesynth.face.draw.raster import vertex_normals
from facesynth.face.draw.shading import EYE, HIDDEN, SKIN, TEETH, TONGUE, Surface
from facesynth.face.draw.strands import Skin, Strands, grow_all, hair_volume_mm
from facesynth.face.draw.subdivision import catmull_clark, refine_corners
from facesynth.face.rig.anny import PARTS, head_folder, head_key
from facesynth.face.rig.arkit_rig import Rig, pose
from facesynth.face.rig.brows import step
from facesynth.face.rig.markers import INNER_LIPS, MIDDLE_LIPS
from facesynth.inference.errors import FacesynthError
from facesynth.inference.npz import read_all_arrays

_VERSION = 3  # raise it whenever what is baked changes
_MATERIALS = np.array([SKIN, EYE, EYE, TEETH, TEETH, TONGUE, HIDDEN, HIDDEN, HIDDEN, HIDDEN], np.uint8)
_STRAND_FIELDS = ("lift_mm", "segments", "width_mm", "colour", "horizon", "raised_mm")
_LIT = LitSphere(np.array([0.0, -30.0, 60.0]), 190.0)
_LIP_DEPTH_MM = 146.0  # z of the lips at rest: the mouth darkens behind it


@dataclass(frozen=True, eq=False)
class Baked:
    """What takes seconds to work out."""

    refine: sparse.csr_matrix
    """[N, V] cage vertices to fine vertices."""
    surface: Surface
    strands: Strands
    cap_mm: NDArray[np.float32]
    """[N] thickness of the hair over each vertex, for the shadow it throws."""


def built_in_look(rig: Rig) -> Look:
    """The built-in head with hair, eyes, teeth and painted skin."""
    baked = baked_head(rig)
    left, right = (
        Eyeball(ball := rig.vertices_of(f"{side}_eye"), rig.rest_mm[ball], rig.eye_centre_mm(side)) for side in ("left", "right")
    )
    return Look(
        baked.surface,
        _LIT,
        Camera(),
        refine=baked.refine,
        strands=baked.strands,
        cap_mm=baked.cap_mm,
        eyes=(left, right),
        lips=rig.from_source(np.array(INNER_LIPS[MIDDLE_LIPS]).T),
        furrows=True,
    )


def baked_head(rig: Rig) -> Baked:
    """What `bake` makes of the built-in head, from the user's cache where it is there."""
    path = cache_dir("head") / f"look-{_VERSION}-{head_key(head_folder())}.npz"
    if path.is_file():
        try:
            return _unpacked(read_all_arrays(path, "the look of a head"))
        except FacesynthError:
            path.unlink(missing_ok=True)  # damaged: it can be made again
    baked = bake(rig)
    with atomic_path(path) as part:
        np.savez_compressed(part, allow_pickle=False, **_packed(baked))
    return baked


def bake(rig: Rig) -> Baked:
    """Refine, paint, darken what sees little sky, and grow hair: about ten seconds."""
    refine, fine = catmull_clark(len(rig.rest_mm), rig.quads)
    order = _skin_first(rig)
    fine, part = fine[order], np.repeat(rig.quad_part, 4)[order]
    corner_uv = fine_corner_uv(rig)
    rest = np.ascontiguousarray(refine @ rig.rest_mm, np.float32)
    material = _MATERIALS[part]
    skin_quads = fine[material == SKIN]
    masks = head_folder() / "mpfb2/textures"
    inner = inside_mouth(corner_uv[material == SKIN], masks)
    surface = Surface(
        fine,
        material,
        rest,
        _occlusion(rig, refine, skin_quads),
        _cavity(rest, fine, material, skin_quads, inner),
        paint_skin(rest[skin_quads], corner_uv[material == SKIN], masks),
    )
    skin = Skin(rest, vertex_normals(rest, fine), skin_quads)
    cap = (0.6 * scalp(rest.astype(np.float64)) * hair_volume_mm(rest.astype(np.float64))).astype(np.float32)
    cap[np.setdiff1d(np.arange(len(rest)), skin_quads)] = 0
    return Baked(refine, surface, grow_all(skin, _lash_cards(rig, fine, part)), cap)


def fine_corner_uv(rig: Rig) -> NDArray[np.float32]:
    """[F, 4, 2] texture coordinates of the corners of the fine quads, in the surface's order."""
    return refine_corners(rig.corner_uv)[_skin_first(rig)]


def _skin_first(rig: Rig) -> NDArray[np.int64]:
    """[F] order of the fine quads: those of the skin number the patches of texture."""
    return np.argsort(_MATERIALS[np.repeat(rig.quad_part, 4)], kind="stable")


def _occlusion(rig: Rig, refine: sparse.csr_matrix, quads: NDArray[np.int32]) -> NDArray[np.float32]:
    """[N] the most that each point sees of the sky at rest, with the jaw open and with the eyes shut."""
    seen = []
    for names, value in (((), 0.0), (("jawOpen",), 0.45), (("eyeBlinkLeft", "eyeBlinkRight"), 0.8)):
        weights = np.zeros(52)
        weights[rig.index(*names)] = value
        points = np.ascontiguousarray(refine @ pose(rig, weights), np.float32)
        seen.append(sky_visibility(points, vertex_normals(points, quads), quads))
    occlusion = np.max(seen, axis=0)
    bare = np.setdiff1d(np.arange(len(occlusion)), quads)
    occlusion[bare] = 1.0  # eyes and teeth darken by their own rules
    return occlusion


def _cavity(
    rest: NDArray[np.float32],
    fine: NDArray[np.int32],
    material: NDArray[np.uint8],
    skin_quads: NDArray[np.int32],
    inner: NDArray[np.float64],
) -> NDArray[np.float32]:
    """[N] how far light reaches: 1 outside the mouth, falling to almost nothing 25 mm behind the lips."""
    inside = np.zeros(len(rest))
    np.maximum.at(inside, skin_quads, inner)
    inside[fine[np.isin(material, (TEETH, TONGUE))]] = 1
    reach = 0.05 + 0.95 * step(_LIP_DEPTH_MM - 26, _LIP_DEPTH_MM - 1, rest[:, 2].astype(np.float64))
    return (1 - inside * (1 - reach)).astype(np.float32)


def _lash_cards(
    rig: Rig, fine: NDArray[np.int32], part: NDArray[np.int32]
) -> dict[str, tuple[NDArray[np.int64], NDArray[np.float64]]]:
    cards = {}
    for number, name in enumerate(PARTS):
        if "lashes" in name:
            index = np.unique(fine[part == number]).astype(np.int64)
            cards[name] = (index, rig.eye_centre_mm(name.split("_")[0]))
    return cards


def _packed(baked: Baked) -> dict[str, NDArray]:
    arrays = {f"surface_{name}": value for name, value in baked.surface._asdict().items()}
    arrays |= _packed_matrix("refine", baked.refine) | _packed_matrix("binding", baked.strands.binding)
    arrays |= {f"strand_{name}": getattr(baked.strands, name) for name in _STRAND_FIELDS}
    return arrays | {"cap_mm": baked.cap_mm}


def _unpacked(stored: dict[str, NDArray]) -> Baked:
    strands = {name: stored[f"strand_{name}"] for name in _STRAND_FIELDS}
    return Baked(
        _unpacked_matrix("refine", stored),
        Surface(*(stored[f"surface_{name}"] for name in Surface._fields)),
        Strands(binding=_unpacked_matrix("binding", stored), **strands),
        stored["cap_mm"],
    )


def _packed_matrix(name: str, matrix: sparse.csr_matrix) -> dict[str, NDArray]:
    return {f"{name}_{key}": getattr(matrix, key) for key in ("data", "indices", "indptr")} | {
        f"{name}_shape": np.array(matrix.shape)
    }


def _unpacked_matrix(name: str, stored: dict[str, NDArray]) -> sparse.csr_matrix:
    data, indices, indptr = (stored[f"{name}_{key}"] for key in ("data", "indices", "indptr"))
    return sparse.csr_matrix((data, indices, indptr), tuple(stored[f"{name}_shape"]))
