import numpy as np
import pytest
from corpora import tiny_layout

from facesynth.inference.closures import close_at, closing_direction
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.lips import gap, lip_gap
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


def test_a_face_closes_along_as_it_was_recorded_to():
    """The jaw goes twice as far as the lips' gap: where that is learned, one unit less of gap takes the jaw two up."""
    layout = Layout("landmarks", ("upper", "lower", "jaw", "ear"), lip_pairs=((0, 1),))
    opening = np.abs(np.random.default_rng(0).normal(size=200))
    frames = np.zeros((200, 8))
    frames[:, 1], frames[:, 3], frames[:, 5], frames[:, 7] = 5, 5 - opening, -2 * opening, 7
    along = closing_direction(frames, layout)
    np.testing.assert_allclose(along, [0, 0, 0, 1, 0, 2, 0, 0], atol=1e-9)
    closed = close_at(frames[:30], layout, [(10, 14)], -0.5, 25.0, along)
    assert gap(closed, layout)[10:14].min() == pytest.approx(-0.5)
    moved = closed - frames[:30]
    np.testing.assert_allclose(moved[:, 5], 2 * moved[:, 3], atol=1e-9)
    assert not moved[:5].any()


def test_lips_that_never_move_have_no_direction():
    layout = Layout("landmarks", ("upper", "lower"), lip_pairs=((0, 1),))
    assert closing_direction(np.tile([0.0, 1, 0, 0], (20, 1)), layout) is None
    assert closing_direction(np.zeros((20, 1)), Layout("curves", ("jawOpen",))) is None
