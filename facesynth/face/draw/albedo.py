"""The colour of skin, lips, stubble, scalp and shirt, painted by rule from the rest pose of the built-in head.

Every fine quad carries its own little patch of texels whose outer ones lie on its edges, where the
neighbours have the same: no texture map, no seams, and the same fineness everywhere on the face.

Places in the rules are millimetres on this one mesh, from between the eyes: where its nose, cheeks, lips and ears lie.
Colours and strengths were set by looking at pictures under this renderer's lights. Other heads bring their own colours.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from facesynth.face.rig.brows import BROW_LENGTH_MM, BROW_START_MM, over_brow_mm, step

TEXELS = 8
"""Texels along the side of a patch; 0.3 mm apart in the middle of the face."""

Field = NDArray[np.float64]

# Linear albedos; hair and shirt are dark, since the lights are bright.
_SKIN = np.array([0.545, 0.335, 0.245])
_LIPS = np.array([0.43, 0.185, 0.155])
HAIR = np.array([0.030, 0.019, 0.013])
_SHIRT = np.array([0.040, 0.058, 0.088])
_MOUTH = np.array([0.26, 0.070, 0.062])


def paint_skin(corner_mm: NDArray[np.float32], corner_uv: NDArray[np.float32], masks: Path) -> NDArray[np.uint8]:
    """[F, TEXELS, TEXELS, 4] square root of linear albedo, and gloss, for fine skin quads.

    Parameters
    ----------
    corner_mm : [F, 4, 3] rest positions of the quads' corners
    corner_uv : [F, 4, 2] texture coordinates of the corners, into the masks
    masks : folder with the head's masks of lips, eyelids and the inside of the mouth
    """
    place = spread(corner_mm.astype(np.float64))
    uv = spread(corner_uv.astype(np.float64))
    lips, lids, inner = (_mask(masks / f"mpfb_{name}.jpg", uv) for name in ("lips", "eyelids", "inside-mouth"))
    colour = _skin(place, lids, lips)
    lines = _between(0.86, 1.14, noise(place * [1.5, 0.28, 1.0]))
    colour = _mix(colour, _LIPS * lines[..., None], 0.88 * lips)
    gloss = _gloss(place, lips)
    bare = 1 - scalp(place)
    colour, gloss = _mix(colour, HAIR, 1 - bare), gloss * (0.25 + 0.75 * bare)
    inside = step(0.3, 0.9, inner)
    colour, gloss = _mix(colour, _MOUTH, inside), gloss + (0.55 - gloss) * inside
    colour, gloss = _dressed(place, colour, gloss)
    texels = np.concatenate([np.sqrt(np.clip(colour, 0, 1)), np.clip(gloss, 0, 1)[..., None]], axis=-1)
    return np.round(255 * texels).astype(np.uint8)


def inside_mouth(corner_uv: NDArray[np.float32], masks: Path) -> NDArray[np.float64]:
    """[F, 4] how far each corner of a quad lies inside the mouth, 0..1."""
    return step(0.3, 0.6, _mask(masks / "mpfb_inside-mouth.jpg", corner_uv.astype(np.float64)))


def hairline_mm(place: Field) -> Field:
    """[...] height of a point over the hairline, mm: positive where hair grows.

    The line is 62 mm over the eyes in the middle of this forehead, falls to the sides as a parabola, and behind the front
    (z < 95) runs down to the neck.
    """
    x, y, z = np.moveaxis(place, -1, 0)
    across = np.abs(x)
    line = 62 - 0.0042 * x**2 - np.maximum(0, 95 - z) * 0.62 - np.maximum(0, across - 62) * 0.5
    line = line + 5.0 * np.exp(-(((across - 46) / 12) ** 2))  # the temples recede a little
    over = y - np.maximum(line, -78)
    behind_ear = (across > 69) & (y < 20) & (z > -2)
    return np.where(behind_ear, -50, over)


def scalp(place: Field) -> Field:
    """[...] 0..1 how dark the scalp is with the roots of hair."""
    ragged = 7.0 * (noise(place * 0.35) - 0.5)
    return 0.93 * step(-3.0, 13.0, hairline_mm(place) + ragged)


def brow_shade(place: Field) -> Field:
    """[...] 0..1 where the eyebrows grow: an arch that starts thick by the nose and thins out to the temple."""
    along = (np.abs(place[..., 0]) - BROW_START_MM) / BROW_LENGTH_MM
    half = (4.4 - 2.9 * step(0.25, 1.0, along)) * step(-0.06, 0.16, along)
    inside = step(1.15, 0.35, np.abs(over_brow_mm(place)) / np.maximum(half, 0.1))
    return inside * ((along > -0.04) & (along < 1.0) & (place[..., 2] > 95)) * step(1.02, 0.8, along)


def spread(corners: Field) -> Field:
    """Values [F, 4, D] at the corners of quads, bilinearly at their texels [F, TEXELS, TEXELS, D]."""
    t = np.linspace(0, 1, TEXELS)
    s, t = t[:, None], t[None, :]
    weights = np.stack([(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t], axis=-1)
    return np.einsum("ijc,fcd->fijd", weights, corners)


def noise(place: Field) -> Field:
    """[...] smooth value noise in 0..1 at points [..., 3]; its features are about one unit wide."""
    return _value_noise(np.ascontiguousarray(place.reshape(-1, 3), np.float64)).reshape(place.shape[:-1])


def _skin(place: Field, lids: Field, lips: Field) -> Field:
    """Linear albedo of the skin.

    Mottled at four sizes, 20 mm (blotches) to half a millimetre (pores). Redder, that is less green and blue, where blood lies
    near the surface: cheeks, nose, ears, chin; yellower on the forehead; darker under the eyes and on the lids. The bumps are
    Gaussians over those places of this mesh, as wide as what they colour.
    """
    x, y, z = np.moveaxis(place, -1, 0)
    across = np.abs(x)
    mottle = (
        0.90 + 0.07 * noise(place * 0.05) + 0.09 * noise(place * 0.17 + 9) + 0.07 * noise(place * 0.7) + 0.05 * noise(place * 2.1)
    )
    colour = _SKIN * mottle[..., None]
    front = step(40, 95, z)
    cheeks = np.exp(-(((across - 37) / 19) ** 2) - ((y + 33) / 16) ** 2) * front
    nose = np.exp(-((x / 15) ** 2) - ((y + 33) / 14) ** 2) * step(118, 148, z)
    ears = step(70, 78, across) * ((y > -70) & (y < 25))
    chin = np.exp(-((x / 16) ** 2) - ((y + 98) / 9) ** 2) * front
    blotch = _between(0.6, 1.4, noise(place * 0.11 + 31))
    flush = np.clip((0.75 * cheeks + 0.8 * nose + 0.55 * ears + 0.4 * chin) * blotch, 0, 1)
    colour = colour * (1 + flush[..., None] * [0.02, -0.20, -0.22])
    forehead = np.exp(-((x / 45) ** 2) - ((y - 42) / 18) ** 2) * front
    colour = colour * (1 + 0.6 * forehead[..., None] * [0.03, 0.05, 0.01])
    under_eye = np.exp(-(((across - 27) / 13) ** 2) - ((y + 13) / 5.5) ** 2) * front
    colour = colour * (1 - under_eye[..., None] * [0.10, 0.13, 0.06])
    colour = colour * (1 - lids[..., None] * [0.10, 0.20, 0.20])
    colour = colour * (1 - _spots(place)[..., None] * [0.35, 0.48, 0.55])
    colour = _mix(colour, colour * [0.80, 0.83, 0.87], _stubble(place) * (1 - lips))
    return _mix(colour, HAIR * 1.4, 0.7 * brow_shade(place) * _between(0.6, 1.2, noise(place * [1.6, 0.5, 1])))


def _stubble(place: Field) -> Field:
    """0..1 where a shaved beard shows: from below the nose to the throat of this mesh, beginning lower at the sides."""
    x, y, z = np.moveaxis(place, -1, 0)
    beard = step(-44, -60, y + 0.12 * np.abs(x)) * step(-150, -108, y) * step(15, 62, z)
    return beard * _between(0.45, 1.25, noise(place * 2.7)) * _between(0.75, 1.1, noise(place * 0.3 + 5))


def _spots(place: Field) -> Field:
    """A few freckles and moles, each about a millimetre wide."""
    rng = np.random.default_rng(11)
    centres = np.stack([rng.uniform(-55, 55, 26), rng.uniform(-105, 55, 26)], axis=1)
    strength, width = rng.uniform(0.15, 0.6, 26), rng.uniform(0.5, 1.1, 26)
    total = np.zeros(place.shape[:-1])
    for (x, y), s, w in zip(centres, strength, width, strict=True):
        total += s * np.exp(-((place[..., 0] - x) ** 2 + (place[..., 1] - y) ** 2) / w**2)
    return np.clip(total, 0, 1) * (place[..., 2] > 70)


def _gloss(place: Field, lips: Field) -> Field:
    """0..1: skin shines most where it is oily, in the middle of the forehead and along the nose; lips more than skin."""
    x, y, z = np.moveaxis(place, -1, 0)
    oily = np.exp(-((x / 22) ** 2) - ((y - 38) / 26) ** 2) + np.exp(-((x / 13) ** 2) - ((y + 25) / 24) ** 2)
    pores = _between(0.55, 1.35, noise(place * 1.3)) * _between(0.7, 1.25, noise(place * 2.9 + 3))
    skin = (0.30 + 0.22 * np.clip(oily, 0, 1) * (z > 90)) * pores
    return skin + (0.62 - skin) * lips


def _dressed(place: Field, colour: Field, gloss: Field) -> tuple[Field, Field]:
    """A round-necked shirt below a line around the neck, with a ribbed collar 7 mm wide."""
    x, y, z = np.moveaxis(place, -1, 0)
    edge = -166 + 0.0022 * x**2 - 0.10 * z
    cloth = step(1.6, -1.6, y - edge)
    knit = 0.85 + 0.3 * noise(place * 0.9)
    ribs = np.where((y > edge - 8) & (y < edge), 0.75 + 0.35 * step(0.25, 0.75, np.abs(((x + z) * 0.28) % 1 - 0.5) * 2), 1.0)
    seam = 1 - 0.5 * np.exp(-(((y - edge + 8) / 0.8) ** 2))
    return _mix(colour, _SHIRT * (knit * ribs * seam)[..., None], cloth), gloss * (1 - 0.94 * cloth)


def _mix(under: Field, over: Field, share: Field) -> Field:
    return under + (over - under) * share[..., None]


def _between(low: float, high: float, share: Field) -> Field:
    return low + (high - low) * share


def _mask(path: Path, uv: Field) -> Field:
    from PIL import Image

    with Image.open(path) as image:
        grey = np.asarray(image.convert("L"), np.float32) / 255
    size = np.array(grey.shape[::-1]) - 1
    column, row = np.moveaxis(np.clip(np.round(uv * [1, -1] * size + [0, size[1]]).astype(np.int64), 0, size), -1, 0)
    return grey[row, column].astype(np.float64)


@njit(cache=True, nogil=True, error_model="numpy")
def _lattice(x: int, y: int, z: int) -> float:
    """A reproducible number in 0..1 for a point of the integer lattice (mixing by large odd factors)."""
    h = np.uint32(x * 374761393 + y * 668265263 + z * 2147483647)
    h = np.uint32((h ^ (h >> np.uint32(13))) * np.uint32(1274126177))
    h = np.uint32((h ^ (h >> np.uint32(16))) * np.uint32(2246822519))
    return (h ^ (h >> np.uint32(13))) / 4294967296.0


@njit(cache=True, nogil=True, error_model="numpy")
def _value_noise(points: NDArray[Any]) -> NDArray[np.float64]:
    out = np.empty(len(points))
    for i in range(len(points)):
        x, y, z = np.floor(points[i, 0]), np.floor(points[i, 1]), np.floor(points[i, 2])
        u, v, w = points[i, 0] - x, points[i, 1] - y, points[i, 2] - z
        u, v, w = u * u * (3 - 2 * u), v * v * (3 - 2 * v), w * w * (3 - 2 * w)
        total = 0.0
        for k in range(8):
            dx, dy, dz = k & 1, (k >> 1) & 1, k >> 2
            share = (u if dx else 1 - u) * (v if dy else 1 - v) * (w if dz else 1 - w)
            total += share * _lattice(int(x) + dx, int(y) + dy, int(z) + dz)
        out[i] = total
    return out
