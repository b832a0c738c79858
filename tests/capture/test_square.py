import numpy as np
import pytest

from facesynth.capture.square import Square


@pytest.mark.parametrize("tilt", [0.0, 0.4, -1.2])
def test_what_is_cut_out_lies_where_in_picture_says(tilt):
    image = np.zeros((120, 160, 3), np.uint8)
    image[60:63, 90:93] = 255
    square = Square(85.0, 66.0, 48.0, tilt)
    content = square.cut(image, 96)[..., 0]
    rows, columns = np.nonzero(content > 0.5)
    found = square.in_picture(np.array([columns.mean() + 0.0, rows.mean() + 0.0]) / 96)
    assert np.abs(found - [91.0, 61.0]).max() < 0.6


def test_beyond_the_picture_is_black():
    content = Square(0.0, 0.0, 100.0).cut(np.full((40, 40, 3), 200, np.uint8), 50)
    assert content.shape == (50, 50, 3)
    assert content.dtype == np.float32
    assert content[:20, :20].max() == 0
    assert content[26:40, 26:40].min() == pytest.approx(200 / 255)
