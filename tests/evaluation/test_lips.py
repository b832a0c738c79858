import numpy as np
import pytest
from talking_points import FPS, LAYOUT, face, phones, talk

from facesynth.evaluation import lips, timing
from facesynth.evaluation.pair import UnavailableError
from facesynth.evaluation.time_alignment import dtw_path
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion


def test_identity_and_opposite():
    truth = talk()
    opposite = face(12 - truth.points[:, 5, 1] + truth.points[:, 7, 1])
    assert lips.lip_gap_corr(truth, truth) == pytest.approx(1)
    assert lips.lip_gap_ccc(truth, truth) == pytest.approx(1)
    assert lips.lip_gap_corr(opposite, truth) == pytest.approx(-1)


def test_concordance_falls_with_an_offset_and_a_size_that_pearson_does_not_see():
    gap = 5 + np.sin(np.arange(300) / 7)
    truth, wide, large = face(gap), face(gap + 2), face(2 * gap)
    assert lips.lip_gap_corr(wide, truth) == pytest.approx(1)
    assert lips.lip_gap_ccc(wide, truth) == pytest.approx(2 * gap.var() / (2 * gap.var() + 4), rel=1e-4)
    expected = 4 * gap.var() / (5 * gap.var() + gap.mean() ** 2)
    assert lips.lip_gap_ccc(large, truth) == pytest.approx(expected, rel=1e-4)


def test_a_mouth_that_stands_still_follows_nothing_and_cannot_be_followed():
    still = face(np.full(240, 5.0))
    assert lips.lip_gap_corr(still, talk()) == 0
    assert lips.lip_gap_ccc(still, talk()) == pytest.approx(0)
    for metric in (lips.lip_gap_corr, lips.lip_gap_ccc, timing.lip_lag, timing.lip_extrema_lag):
        with pytest.raises(UnavailableError, match="stands still"):
            metric(talk(), still)


def said(closures, opening=8.0):
    """A face saying pau and then ah p ah p … of 0.2 s each, with the given smallest gaps at each p."""
    gaps, track = [np.full(12, opening)], [("pau", 0.2)]
    for gap in closures:
        for label, value in (("ah", opening), ("p", gap)):
            gaps.append(np.full(12, value))
            track.append((label, track[-1][1] + 0.2))
    return face(np.concatenate(gaps)), phones(*track)


def test_the_truth_itself_has_a_closure_rate_of_nine_tenths():
    recordings = [said(np.arange(10 * i, 10 * i + 10) / 10) for i in range(2)]
    threshold = lips.closure_threshold(recordings)
    assert threshold == pytest.approx(1.7, abs=1e-4)
    rates = [lips.closure_rate(motion, track, threshold) for motion, track in recordings]
    assert np.mean(rates) == pytest.approx(0.9)


def test_closures_are_counted_and_a_shut_mouth_cannot_win():
    motion, track = said([0, 1, 2, 3])
    assert lips.closure_rate(motion, track, 1.5) == 0.5
    assert lips.false_closure_rate(motion, track, 1.5) == 0
    shut = face(np.zeros(len(motion)))
    assert lips.closure_rate(shut, track, 1.5) == 1
    assert lips.false_closure_rate(shut, track, 1.5) == 1


def test_a_vowel_may_start_from_shut_lips():
    gap = np.concatenate([np.zeros(12), np.linspace(0, 9, 12)])
    assert lips.false_closure_rate(face(gap), phones(("m", 0.2), ("ah", 0.4)), 1.0) == 0


def test_a_phone_shorter_than_a_frame_still_has_its_frame():
    gap = np.array([9.0, 9, 0, 9, 9])
    assert lips.closure_rate(face(gap, fps=25.0), phones(("ah", 0.081), ("b", 0.095), ("ah", 0.2)), 1.0) == 1


def test_closures_without_anybody_to_close_are_unavailable():
    motion, track = face(np.full(12, 4.0)), phones(("s", 0.2))
    with pytest.raises(UnavailableError, match="p, b or m"):
        lips.closure_rate(motion, track, 1.0)
    with pytest.raises(UnavailableError, match="open vowel"):
        lips.false_closure_rate(motion, track, 1.0)
    with pytest.raises(UnavailableError, match="p, b or m"):
        lips.closure_threshold([(motion, track)])
    with pytest.raises(UnavailableError, match="threshold"):
        lips.closure_rate(*said([0.0]), float("nan"))


def test_closures_are_refused_where_a_still_face_would_have_them_all():
    recording = said([5.0, 5.5, 6.0, 6.5], opening=6.2)
    with pytest.raises(UnavailableError, match="still face"):
        lips.require_parting([recording[0]], lips.closure_threshold([recording]))
    parting = said([0.0, 0.5, 1.0, 1.5], opening=6.2)
    lips.require_parting([parting[0]], lips.closure_threshold([parting]))


def test_phones_of_another_motion_are_refused():
    motion, track = said([0, 0, 0, 0])
    with pytest.raises(FacesynthError, match="phones of this motion"):
        lips.closure_rate(Motion(motion.frames[:40], FPS, LAYOUT), track, 1.0)


def test_without_lip_pairs_there_is_no_opening():
    layout = Layout("markers", LAYOUT.names, LAYOUT.groups)
    with pytest.raises(UnavailableError, match="inner-lip"):
        lips.lip_opening(Motion(talk().frames, FPS, layout))


@pytest.mark.parametrize("fps", [25.0, 60.0, 120.0])
@pytest.mark.parametrize("delay_ms", [-120, -50, 0, 30, 100])
def test_a_delay_is_found_to_a_fraction_of_a_frame(fps, delay_ms):
    late, truth = talk(6.0, fps, delay_ms / 1000), talk(6.0, fps)
    assert timing.lip_lag(late, truth) == pytest.approx(delay_ms, abs=4)
    assert timing.lip_extrema_lag(late, truth) == pytest.approx(abs(delay_ms), abs=0.35 * 1000 / fps + 6)


def test_size_is_no_delay():
    assert timing.lip_lag(talk(size=2.0), talk()) == pytest.approx(0, abs=1e-3)
    assert timing.lip_extrema_lag(talk(size=2.0), talk()) == 0


def test_warping_path_is_the_least_over_all_paths():
    rng = np.random.default_rng(3)

    def least(a, b, i, j):
        if i < 0 or j < 0:
            return np.inf
        before = 0 if i == j == 0 else min(least(a, b, i - 1, j - 1), least(a, b, i - 1, j), least(a, b, i, j - 1))
        return ((a[i] - b[j]) ** 2).sum() + before

    for _ in range(5):
        a, b = rng.normal(size=(2, 6, 2))
        path = dtw_path(a, b, 6)
        assert ((a[path[:, 0]] - b[path[:, 1]]) ** 2).sum() == pytest.approx(least(a, b, 5, 5))
        assert path[[0, -1]].tolist() == [[0, 0], [5, 5]]
        assert (np.diff(path, axis=0) >= 0).all()
        assert (np.abs(np.diff(dtw_path(a, b, 1), axis=1)) <= 1).all()


def test_curves_open_the_mouth_of_the_built_in_head(rig):
    layout = Layout("curves", ("jawOpen", "mouthClose"), {"mouth": (0, 1)})
    jaw = 0.3 + 0.2 * np.sin(np.arange(60) / 5)
    gap = lips.lip_opening(Motion(np.stack([jaw, np.zeros(60)], 1), 30, layout))
    assert np.corrcoef(gap, jaw)[0, 1] == pytest.approx(1)
    assert 20 < np.ptp(gap) / np.ptp(jaw) < 40  # mm per unit of jawOpen
    assert lips.lip_opening(Motion(np.stack([jaw, jaw], 1), 30, layout)).max() < 2


def test_other_curves_have_no_opening():
    with pytest.raises(UnavailableError, match="ARKit"):
        lips.lip_opening(Motion(np.zeros((5, 1)), 30, Layout("curves", ("smile",))))
