import numpy as np
import pytest
from scipy.stats import kurtosis
from talking_points import FPS, face, moved, phones, talk

from facesynth.corpus import Utterance
from facesynth.evaluation.curve import GAINS
from facesynth.evaluation.details import DetailSums, overall_aligned, residual_reach
from facesynth.evaluation.geometry import lve, lve_centred
from facesynth.evaluation.time_alignment import aligned_distances
from facesynth.inference.speech import EmotionTrack, Speech

TRACK = phones(("pau", 0.5), ("m", 1.0), ("aa", 2.0), ("m", 3.0), ("pau", 4.0))


def utterance(motion):
    speech = Speech(np.zeros(64000, np.float32), 16000, TRACK, EmotionTrack.constant("neutral", 4.0), "mam")
    return Utterance("u", speech, motion, "s", 1, "somebody")


def details(motion, truth=None):
    said = utterance(truth or talk())
    sums = DetailSums(residual_reach([said]))
    sums.add(said, motion)
    return sums.details()


def test_errors_are_laid_to_the_phones_during_which_they_happen():
    frames = talk().frames.copy()
    frames[60:120] += 2.0
    found = {one.phone: one for one in details(moved(talk(), frames)).phones}
    assert set(found) == {"m", "aa"}
    assert found["m"].count == 2
    assert found["aa"].marker_error == pytest.approx(2 * np.sqrt(3))
    assert found["aa"].lip_error == pytest.approx(2 * np.sqrt(3))
    assert found["m"].marker_error == found["m"].lip_error == 0
    whole = overall_aligned(found.values())
    assert whole["marker_error"] == pytest.approx(found["aa"].marker_error / 3)


def test_what_is_merely_late_is_forgiven_by_alignment():
    late = details(talk(delay_s=0.05))
    for one in late.phones:
        assert one.aligned_lip_error < 0.4 * one.lip_error
    too_late = details(talk(delay_s=0.3))
    assert all(one.aligned_lip_error > 0.5 for one in too_late.phones)


def test_alignment_never_makes_an_offset_disappear_and_leaves_missing_frames_out():
    still = face(np.full(120, 3.0))
    aside = still.points.astype(float) + np.array([0, 0, 2.0])
    yours = still.points.astype(float)
    assert aligned_distances(aside, yours, FPS) == pytest.approx(np.full(120, 2.0))
    yours[40:60] = np.nan
    aside[40:60] = np.nan
    apart = aligned_distances(aside, yours, FPS)
    assert np.isnan(apart[40:60]).all()
    assert apart[:40] == pytest.approx(2.0)


def test_the_face_shows_which_point_is_off():
    frames = talk().points.copy()
    frames[:, 11] += [0, 3, 4]
    points = details(moved(talk(), frames.reshape(len(frames), -1))).points
    assert points[11] == pytest.approx(5)
    assert points[:11] == pytest.approx(np.zeros(11))


def test_residuals_beyond_the_histogram_are_in_its_outer_bins():
    one = details(moved(talk(), talk().frames + 1000))
    assert one.histogram.sum() == pytest.approx(1)
    assert one.histogram[-1] == pytest.approx(1)
    assert details(talk()).histogram[len(one.histogram) // 2] == pytest.approx(1)


def test_spread_and_kurtosis_are_those_of_the_residuals_and_not_of_the_bins():
    noise = 8 * np.random.default_rng(0).standard_t(5, talk().frames.shape).astype(np.float32)
    motion = moved(talk(), talk().frames + noise)
    one = details(motion)
    residuals = (motion.points - talk().points)[:, [5, 6, 7, 8, 9]].astype(float).ravel()
    assert (np.abs(residuals) > one.histogram_reach).mean() > 0.02
    assert one.residual_mean == pytest.approx(residuals.mean(), rel=1e-6)
    assert one.residual_spread == pytest.approx(residuals.std(), rel=1e-6)
    assert one.residual_kurtosis == pytest.approx(kurtosis(residuals), rel=1e-6)
    assert details(talk()).residual_spread == 0


def test_the_curve_passes_through_the_method_and_ends_where_nothing_moves():
    motion = talk(size=0.8, delay_s=0.04)
    trade = sorted((point for point in details(motion).trade if point.sharpening == 0), key=lambda point: point.gain)
    assert [point.gain for point in trade] == sorted((*GAINS, 1.0))
    here = next(point for point in trade if point.gain == 1.0)
    assert here.lve == pytest.approx(lve(motion, talk()))
    assert here.lve_centred == pytest.approx(lve_centred(motion, talk()))
    assert trade[0].energy_ratio == 0
    assert [point.energy_ratio for point in trade] == pytest.approx([point.gain * here.energy_ratio for point in trade])
