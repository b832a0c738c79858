"""A ruler of lips on drawn mouths whose opening is known to the millimetre."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from facesynth.capture.landmarks import LIP_PAIRS, LOWER_INNER, OUTER_CORNERS, UPPER_INNER
from facesynth.capture.lip_ruler import LipRuler, Samples, line, mesh_gaps, mm_per_px
from facesynth.inference.errors import FacesynthError

HEIGHT, WIDTH, MIDDLE = 120, 120, 60.0
SKIN, LIP, DARK, TEETH = (np.array(colour, float) for colour in ([150, 120, 95], [140, 85, 70], [50, 25, 20], [200, 180, 150]))
MM = 1.25
"""Of a pixel."""
LIP_MM = 7.0


def mouth(gap_mm, between=DARK, thick_mm=LIP_MM, light=1.0):
    """[H, W, 3] lips on skin, `gap_mm` apart, darker where they touch, as a camera sees them."""
    over = 8
    y = (np.arange(HEIGHT * over) + 0.5) / over - 0.5 - MIDDLE
    away, half = np.abs(y * MM), gap_mm / 2
    column = np.where((away < half + thick_mm)[:, None], LIP, SKIN)
    column = column * np.where(away < half + 1.0, 0.7, 1.0)[:, None]
    column = np.where((away < half)[:, None], between, column)
    column = column.reshape(HEIGHT, over, 3).mean(axis=1)
    blurred = gaussian_filter(column, (0.7, 0))
    return np.repeat((light * blurred).clip(0, 255)[:, None], WIDTH, axis=1).round().astype(np.uint8)


def points(gap_mm):
    """[468, 2] px: corners of the eyes, and inner lips as a mesh has them: 3 mm apart where they are shut, or open up to 4 mm."""
    out = np.zeros((468, 2))
    out[list(OUTER_CORNERS)] = [[24, 20], [24 + 90 / MM, 20]]
    half = (3 + max(gap_mm - 4, 0)) / 2 / MM
    x = np.linspace(40, 80, len(UPPER_INNER))
    out[list(UPPER_INNER)] = np.column_stack([x, np.full(len(x), MIDDLE - half)])
    out[list(LOWER_INNER)] = np.column_stack([x[1:-1], np.full(len(x) - 2, MIDDLE + half)])
    return out


def clip(thick_mm):
    """Pictures, mesh and spans of p, b and m of a clip whose lips shut twice and open 11 mm."""
    gaps = [11.0, 6, 0, 6, 12, 11, 5, 0, 5, 11]
    frames = np.stack([mouth(gap, TEETH if t % 2 else DARK, thick_mm) for t, gap in enumerate(gaps)])
    return frames, np.stack([points(gap) for gap in gaps]), [(1, 4), (6, 9)]


@pytest.fixture(scope="module")
def ruler():
    return LipRuler.learn([Samples.of(*clip(thick)) for thick in (6.5, 7.0, 7.5)])


def read(ruler, gap_mm, *how):
    return float(ruler.read(line(mouth(gap_mm, *how), points(gap_mm), MM)[None])[0])


@pytest.mark.parametrize("between", [DARK, TEETH], ids=["dark", "teeth"])
@pytest.mark.parametrize("gap_mm", [0.0, 1.0, 2.0, 3.5, 6.0])
def test_a_gap_is_read_to_half_a_millimetre_or_a_quarter_where_the_mesh_sees_none(ruler, gap_mm, between):
    assert read(ruler, gap_mm, between) == pytest.approx(gap_mm, abs=0.5, rel=0.25)


@pytest.mark.parametrize("light", [0.6, np.array([1.1, 0.9, 0.7])], ids=["dim", "other white balance"])
def test_light_and_white_balance_do_not_count(ruler, light):
    for gap_mm in (0.0, 2.0):
        assert read(ruler, gap_mm, DARK, LIP_MM, light) == pytest.approx(read(ruler, gap_mm), abs=0.2)


def test_lips_that_did_not_close_are_no_examples_of_shut_ones(ruler):
    frames, mesh, _ = clip(LIP_MM)
    clips = [Samples.of(*clip(thick)) for thick in (6.5, 7.0, 7.5)]
    again = LipRuler.learn([*clips, Samples.of(frames, mesh, [(4, 6), (9, 10)])])
    assert read(again, 2.0) == pytest.approx(read(ruler, 2.0), abs=0.1)


def test_the_mesh_is_in_millimetres():
    mesh = np.stack([points(0.0), points(9.0)])
    assert mm_per_px(mesh) == pytest.approx(MM)
    np.testing.assert_allclose(mesh_gaps(mesh), [3, 8])
    assert LIP_PAIRS[1] == (UPPER_INNER[5], LOWER_INNER[4])


def test_a_speaker_who_never_shuts_his_lips_is_refused():
    frames, mesh, _ = clip(LIP_MM)
    with pytest.raises(FacesynthError, match="lips shut at p, b and m"):
        LipRuler.learn([Samples.of(frames, mesh, [])])
