import numpy as np
import pytest
from talking_points import FPS, LAYOUT, moved, talk

from facesynth.evaluation import geometry
from facesynth.evaluation.metrics import METRICS, Case, metric
from facesynth.evaluation.pair import UnavailableError
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.inference.speech import PhoneTrack

OFFSETS = [geometry.marker_error, geometry.lve]
SQUARES = [geometry.deng_error, geometry.lve_sq]
CENTRED = [geometry.marker_error_centred, geometry.lve_centred]
ALL = [*OFFSETS, *SQUARES, *CENTRED, geometry.unit_cube_rms]


@pytest.mark.parametrize("error", ALL)
def test_the_truth_has_no_error(error):
    assert error(talk(), talk()) == pytest.approx(0, abs=1e-6)


def test_an_offset_of_three_four_zero_is_five_mm_and_twentyfive_square_mm():
    truth = talk()
    shifted = moved(truth, truth.frames + np.tile([3.0, 4.0, 0.0], 12).astype(np.float32))
    assert [error(shifted, truth) for error in OFFSETS] == pytest.approx([5, 5], rel=1e-5)
    assert [error(shifted, truth) for error in SQUARES] == pytest.approx([25, 25], rel=1e-5)
    assert [error(shifted, truth) for error in CENTRED] == pytest.approx([0, 0], abs=1e-4)


def test_unit_cube_rms_of_an_offset_is_its_rms_over_the_longest_side():
    truth = talk()
    shifted = moved(truth, truth.frames + np.tile([3.0, 4.0, 0.0], 12).astype(np.float32))
    both = np.concatenate([truth.points, shifted.points]).reshape(-1, 3)
    side = np.ptp(both, axis=0).max()
    assert geometry.unit_cube_rms(shifted, truth) == pytest.approx(np.sqrt(25 / 3) / side, rel=1e-5)


def test_unit_cube_rms_does_not_depend_on_the_unit():
    truth, other = talk(), talk(delay_s=0.1)
    bigger = geometry.unit_cube_rms(moved(other, other.frames * 10), moved(truth, truth.frames * 10))
    assert bigger == pytest.approx(geometry.unit_cube_rms(other, truth), rel=1e-5)


def test_lip_errors_take_the_worst_lip_point_of_each_frame_and_no_other_point():
    truth = talk()
    frames = truth.frames.copy().reshape(-1, 12, 3)
    frames[:, 11, 0] += 100  # a cheek
    frames[:, 5, 0] += 1
    frames[::2, 9, 0] += 3
    synthesised = moved(truth, frames.reshape(len(truth), -1))
    assert geometry.lve(synthesised, truth) == pytest.approx(2, rel=1e-4)
    assert geometry.lve_sq(synthesised, truth) == pytest.approx((1 + 9) / 2, rel=1e-4)


def test_mouth_stands_in_for_lips_that_are_not_told_apart():
    layout = Layout("markers", LAYOUT.names, {"mouth": (5, 6)}, LAYOUT.lip_pairs, LAYOUT.neutral)
    truth = talk()
    truth = Motion(truth.frames, FPS, layout)
    frames = truth.frames.copy()
    frames[:, 27] += 50  # the mouth's corner, in no group here
    frames[:, 15] += 2
    assert geometry.lve(moved(truth, frames), truth) == pytest.approx(2, rel=1e-5)


def test_samples_that_the_truth_misses_do_not_count():
    truth = talk()
    frames = truth.frames.copy()
    frames[10:60, 15:18] = np.nan
    holes = moved(truth, frames)
    wrong = truth.frames.copy()
    wrong[10:60, 15:18] += 40
    assert geometry.marker_error(moved(truth, wrong), holes) == 0
    assert geometry.lve_centred(moved(truth, wrong), holes) == pytest.approx(0, abs=1e-6)
    assert geometry.unit_cube_rms(moved(truth, wrong), holes) == 0
    nothing = moved(truth, np.full_like(truth.frames, np.nan))
    for error in ALL:
        with pytest.raises(UnavailableError):
            error(truth, nothing)


def test_curves_have_errors_but_no_place_in_space():
    layout = Layout("curves", ("jawOpen", "mouthClose"), {"mouth": (0, 1)})
    truth, other = Motion(np.zeros((9, 2), np.float32), 30, layout), Motion(np.full((9, 2), 0.5, np.float32), 30, layout)
    assert geometry.marker_error(other, truth) == geometry.lve(other, truth) == 0.5
    with pytest.raises(UnavailableError, match="space"):
        geometry.unit_cube_rms(other, truth)


def _renamed(motion):
    layout = Layout("markers", tuple(name + "x" for name in LAYOUT.names), LAYOUT.groups, LAYOUT.lip_pairs, LAYOUT.neutral)
    return Motion(motion.frames, motion.fps, layout)


MISMATCHES = {
    "frames": lambda m: Motion(m.frames[:-1], m.fps, m.layout),
    "fps": lambda m: Motion(m.frames, m.fps * 1.001, m.layout),
    "layout": _renamed,
    "NaN": lambda m: Motion(np.where(np.arange(len(m))[:, None] == 7, np.nan, m.frames), m.fps, m.layout),
}


@pytest.mark.parametrize("name", [m.name for m in METRICS if "closure" not in m.name])
@pytest.mark.parametrize("word", MISMATCHES)
def test_every_metric_of_pairs_refuses_what_does_not_match(name, word):
    head = np.random.default_rng(0).normal(0, 0.1, (240, 6))
    truth = talk()
    truth = Motion(truth.frames, truth.fps, truth.layout, head)
    case = Case(MISMATCHES[word](truth), truth, PhoneTrack(("pau",), np.array([4.0])), 1.0)
    with pytest.raises(FacesynthError, match=word) as caught:
        metric(name).measure(case)
    assert not isinstance(caught.value, UnavailableError)


def test_an_unknown_metric_is_answered_with_the_nearest():
    with pytest.raises(FacesynthError, match="marker_error"):
        metric("markererror")
