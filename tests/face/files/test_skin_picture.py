"""The skin's picture: the colours of the painted head, where the texture map says they are."""

import io

import numpy as np
import pytest
from PIL import Image

from facesynth.face.files.gltf.built_in import SIDE, skin_jpeg
from facesynth.face.rig.anny import PARTS
from facesynth.face.rig.markers import INNER_LIPS


@pytest.fixture(scope="module")
def picture(rig):
    return np.asarray(Image.open(io.BytesIO(skin_jpeg(rig)))).astype(np.float64)


def colour_near(rig, picture, place_mm):
    """Mean colour of the skin's corners within 3 mm of a place."""
    skin = rig.quad_part == PARTS.index("skin")
    corners, uv = rig.quads[skin].ravel(), rig.corner_uv[skin].reshape(-1, 2)
    near = (
        np.linalg.norm(rig.rest_mm[corners] - place_mm, axis=1)
        < 3 + np.linalg.norm(rig.rest_mm[corners] - place_mm, axis=1).min()
    )
    column, row = (np.clip([uv[near, 0], 1 - uv[near, 1]], 0, 1) * (SIDE - 1)).astype(int)
    return picture[row, column].mean(axis=0)


def test_lips_are_redder_than_the_forehead_and_the_crown_is_dark(rig, picture):
    skin = rig.vertices_of("skin")
    crown = rig.rest_mm[skin][rig.rest_mm[skin][:, 1].argmax()]
    lower = rig.rest_mm[rig.from_source(np.array(INNER_LIPS[2:5]).T)[1]].mean(axis=0) - np.array([0.0, 3.0, 0.0])
    forehead = np.array([0.0, 45.0, 110.0])
    lips, brow, hair = (colour_near(rig, picture, place) for place in (lower, forehead, crown))
    assert lips[0] / lips[1] > 1.15 * brow[0] / brow[1]
    assert hair.max() < 0.5 * brow.max()


def test_the_same_head_gives_the_same_bytes(rig):
    once = skin_jpeg(rig)
    skin_jpeg.cache_clear()
    assert skin_jpeg(rig) == once
