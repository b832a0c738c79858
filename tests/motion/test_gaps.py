import numpy as np
import pytest

from facesynth.inference.errors import FacesynthError
from facesynth.motion.gaps import Gap, fill_gaps, runs

FPS = 120.0


def cubic(frames: int = 100) -> np.ndarray:
    t = np.arange(frames) / FPS
    return np.column_stack([t**3 - t, 5 * t**2, 1 - 2 * t, t, 0 * t, t**2]).astype(np.float32)


def test_a_cubic_is_filled_exactly():
    frames = cubic()
    holed = frames.copy()
    holed[20:32] = np.nan
    filled, report = fill_gaps(holed, FPS, 3)
    np.testing.assert_allclose(filled, frames, atol=1e-6)
    assert (report.filled_samples, report.long_gaps, report.samples) == (24, (), 200)
    assert np.isnan(holed[20]).all(), "the input stays as it was"


@pytest.mark.parametrize(("length", "is_filled"), [(12, True), (13, False)])
def test_a_tenth_of_a_second_is_the_limit(length, is_filled):
    holed = cubic()
    holed[40 : 40 + length, :3] = np.nan
    filled, report = fill_gaps(holed, FPS, 3)
    assert np.isnan(filled).any() != is_filled
    assert report.long_gaps == (() if is_filled else (Gap(0, 40, 53),))
    assert report.missing_samples == (0 if is_filled else 13)


@pytest.mark.parametrize("where", [slice(0, 3), slice(97, 100)])
def test_edges_stay_open(where):
    holed = cubic()
    holed[where, 3:] = np.nan
    filled, report = fill_gaps(holed, FPS, 3)
    np.testing.assert_array_equal(filled, holed)
    assert report.long_gaps == (Gap(1, where.start, where.stop),)


def test_one_missing_coordinate_is_a_missing_point():
    holed = cubic()
    holed[50, 1] = np.nan
    holed[60:80, 4] = np.nan
    filled, report = fill_gaps(holed, FPS, 3)
    assert report.filled_samples == 1
    assert np.isnan(filled[60:80, 3:]).all()
    assert not np.isnan(filled[:, :3]).any()


def test_a_track_that_is_missing_altogether_and_one_sample_alone():
    holed = np.full((30, 2), np.nan, np.float32)
    holed[10, 1] = 1
    filled, report = fill_gaps(holed, FPS, 1)
    np.testing.assert_array_equal(filled, holed)
    assert report.long_gaps == (Gap(0, 0, 30), Gap(1, 0, 10), Gap(1, 11, 30))


def test_runs():
    assert runs(np.array([1, 0, 1, 1, 0, 1], bool)) == [Gap(0, 0, 1), Gap(0, 2, 4), Gap(0, 5, 6)]
    assert runs(np.zeros(4, bool)) == []


def test_a_wrong_shape_is_refused():
    with pytest.raises(FacesynthError, match="shape"):
        fill_gaps(np.zeros((5, 7), np.float32), FPS, 3)
