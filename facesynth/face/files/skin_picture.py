"""The painted skin of the built-in head as a picture on its texture map, for viewers that do not know our renderer."""

import io

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from facesynth.face.draw.albedo import HAIR, brow_shade, spread
from facesynth.face.draw.bake import baked_head, fine_corner_uv
from facesynth.face.rig.arkit_rig import Rig

SIDE = 2048
"""Pixels along the side of the picture."""
_BROW_DENSITY = 0.8  # the strands of the brows are not part of a mesh: their shade is


def skin_jpeg(rig: Rig) -> bytes:
    """The skin in display values, rows from the top of the texture map down; nothing is left bare between its islands."""
    from PIL import Image

    surface = baked_head(rig).surface
    painted = len(surface.texture)
    uv = spread(fine_corner_uv(rig)[:painted].astype(np.float64)).reshape(-1, 2)
    place = spread(surface.rest[surface.quads[:painted]].astype(np.float64)).reshape(-1, 3)
    albedo = (surface.texture[..., :3].reshape(-1, 3) / 255.0) ** 2
    hairy = _BROW_DENSITY * brow_shade(place)[:, None]
    picture = _scattered(uv, albedo * (1 - hairy) + HAIR * hairy)
    file = io.BytesIO()
    Image.fromarray(np.round(255 * _displayed(picture)).astype(np.uint8)).save(file, "JPEG", quality=90)
    return file.getvalue()


def _scattered(uv: NDArray[np.float64], colour: NDArray[np.float64]) -> NDArray[np.float64]:
    """[SIDE, SIDE, 3] means of the colours that fall on each pixel; empty pixels take the nearest one's."""
    column, row = (np.clip(np.stack([uv[:, 0], 1 - uv[:, 1]]), 0, 1 - 1e-9) * SIDE).astype(np.int64)
    pixel = row * SIDE + column
    count = np.bincount(pixel, minlength=SIDE * SIDE)
    total = np.stack([np.bincount(pixel, channel, SIDE * SIDE) for channel in colour.T], axis=1)
    mean = (total / np.maximum(count, 1)[:, None]).reshape(SIDE, SIDE, 3)
    rows, columns = distance_transform_edt(count.reshape(SIDE, SIDE) == 0, return_distances=False, return_indices=True)
    return mean[rows, columns]


def _displayed(linear: NDArray[np.float64]) -> NDArray[np.float64]:
    """The sRGB curve."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)
