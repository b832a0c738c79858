import numpy as np
import pytest
from corpora import tiny_layout

from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.lips import lip_gap
from facesynth.inference.motion import Motion


def test_mean_height_between_the_pairs():
    layout = Layout("landmarks", ("a", "b", "c", "d"), lip_pairs=((0, 1), (2, 3)))
    frames = np.array([[0, 5, 9, 1, 0, 8, 9, 2], [0, 1, 0, 1, 0, 1, 0, np.nan]], np.float32)
    np.testing.assert_array_equal(lip_gap(Motion(frames, 25, layout)), [5, np.nan])


def test_the_rest_pose_of_a_corpus():
    layout = tiny_layout()
    motion = Motion(np.tile(np.float32(layout.neutral), (3, 1)), 25, layout)
    np.testing.assert_allclose(lip_gap(motion), 1)


@pytest.mark.parametrize("layout", [Layout("curves", ("jawOpen",)), Layout("markers", ("chin",))])
def test_a_layout_without_lips_is_refused(layout):
    with pytest.raises(FacesynthError, match="lip_pairs"):
        lip_gap(Motion(np.zeros((2, layout.channels), np.float32), 25, layout))
