"""The curve of error against motion: its points, its best ones, and what sharpening does to any motion."""

from dataclasses import replace

import numpy as np
import pytest
from corpora import tiny_corpus
from talking_points import moved, talk

from facesynth.evaluation.contestants import SECOND_TAKE, Family
from facesynth.evaluation.curve import GAINS, SHARPENINGS, VARIATIONS, Curve, Point, compromises, curves_of, mean_points
from facesynth.evaluation.curve_figure import curve_figure, highest_shown
from facesynth.evaluation.dynamics import energy_ratio
from facesynth.evaluation.figures import colour_of
from facesynth.evaluation.geometry import lve, lve_centred
from facesynth.inference.filters import sharpen
from facesynth.methods.baselines.mean_face import MeanFace
from facesynth.methods.baselines.phone_mean import PhoneMean

AS_MADE = VARIATIONS.index((1.0, 0.0))


@pytest.fixture(scope="module")
def halves(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("curve") / "corpus", utterances=20, fps=60).split(0)


def point(error, energy, *, centred=0.0, gain=1.0, sharpening=0.0, setting=""):
    return Point(gain, sharpening, energy, energy, error, centred or error, setting)


def sharpened(motion, share):
    return moved(motion, sharpen(motion.frames.astype(np.float64), share, motion.fps).astype(np.float32))


def test_the_front_holds_what_nothing_beats():
    good, lively, worse, wild = point(1.5, 0.6), point(1.7, 0.95), point(1.8, 0.9), point(2.0, 1.5)
    drawn = Curve("x", (wild, worse, lively, good))
    assert drawn.front() == (good, lively)
    assert drawn.nearest() is good
    assert drawn.lively() is lively
    assert Curve("x", (good, wild)).lively() is None
    rows = list(drawn.rows())
    assert [row["lve_front"] for row in rows] == [False, False, True, True]
    assert [row["lve_lively"] for row in rows] == [False, False, True, False]
    assert rows[0]["curve"] == "x"
    assert rows[0]["energy_ratio"] == 1.5


def test_each_measure_has_a_front_of_its_own():
    one, other = point(1.5, 0.6, centred=2.0), point(2.0, 0.6, centred=1.5)
    drawn = Curve("x", (one, other))
    assert drawn.nearest("lve") is one
    assert drawn.nearest("lve_centred") is other
    assert drawn.front("lve") == (one,)
    assert drawn.front("lve_centred") == (other,)


def test_the_points_are_the_metrics_of_the_changed_motions(halves):
    train, test = halves
    model = PhoneMean().fit(train)
    made = [(model.synthesize(u.speech), u.motion) for u in test]
    points = mean_points([compromises(x, y) for x, y in made])
    assert [(p.gain, p.sharpening) for p in points] == list(VARIATIONS)
    for p in points[: len(SHARPENINGS)]:
        changed = [(sharpened(x, p.sharpening), y) for x, y in made]
        assert p.lve == pytest.approx(np.mean([lve(x, y) for x, y in changed]), rel=1e-5)
        assert p.lve_centred == pytest.approx(np.mean([lve_centred(x, y) for x, y in changed]), rel=1e-5)
        assert p.energy_ratio == pytest.approx(np.mean([energy_ratio(x, y) for x, y in changed]), rel=1e-5)
    energies = [p.energy_ratio for p in points[1 : len(SHARPENINGS)]]
    assert energies == sorted(energies)
    for p in points[len(SHARPENINGS) :]:
        scaled = [(moved(x, _scaled(x.frames, p.gain)), y) for x, y in made]
        assert p.lve == pytest.approx(np.mean([lve(x, y) for x, y in scaled]), rel=1e-5)
        assert p.energy_ratio == pytest.approx(np.mean([energy_ratio(x, y) for x, y in scaled]), rel=1e-3, abs=1e-6)


def _scaled(frames, gain):
    mean = frames.mean(axis=0, dtype=np.float64)
    return (mean + gain * (frames - mean)).astype(np.float32)


def test_the_truth_smaller_lies_at_lower_energy_and_larger_error():
    points = mean_points([compromises(talk(), talk())])
    assert points[AS_MADE].lve == pytest.approx(0, abs=1e-6)
    assert points[AS_MADE].energy_ratio == pytest.approx(1)
    smaller = [p for p in points if p.sharpening == 0 and p.gain <= 1]
    by_gain = sorted(smaller, key=lambda p: p.gain)
    assert [p.energy_ratio for p in by_gain] == pytest.approx([p.gain for p in by_gain])
    assert [p.lip_energy_ratio for p in by_gain] == pytest.approx([p.gain for p in by_gain])
    assert np.all(np.diff([p.lve for p in by_gain]) < 0)


def test_a_still_face_gains_nothing_by_sharpening(halves):
    model = MeanFace().fit(halves[0])
    utterance = halves[1][halves[1].ids[0]]
    rows = compromises(model.synthesize(utterance.speech), utterance.motion)
    assert rows[:, 0] == pytest.approx(0, abs=1e-6)
    assert rows[:, 2] == pytest.approx(rows[0, 2], rel=1e-5)


def test_missing_samples_of_the_truth_do_not_count():
    truth = talk()
    frames = truth.frames.copy()
    frames[50:90, 15:18] = np.nan
    assert np.isfinite(compromises(talk(size=0.8), replace(truth, frames=frames))).all()


def test_a_family_that_is_one_method_is_one_curve():
    settings = {name: (point(error, energy), point(error, 1.5, gain=1.5)) for name, error, energy in (("a", 1, 0.5), ("b", 2, 1))}
    family = Family("t", ("a", "b"), curve="both")
    curves = curves_of({**settings, "c": (point(3, 1),), "none": ()}, [family, Family("u", ("c",))])
    assert [curve.label for curve in curves] == ["both", "c"]
    both = curves[0]
    assert [p.setting for p in both.points] == ["a", "b"]
    assert (both.nearest().setting, both.lively().setting) == ("a", "b")
    assert [p.gain for p in both.scaled_of("b")] == [1.0, 1.5]


def test_a_recording_is_a_point_and_no_curve():
    rows = mean_points([compromises(talk(size=0.9), talk())])
    second, method = curves_of({SECOND_TAKE: rows, "m": rows}, ())
    assert len(second.points) == 1
    assert not second.scaled
    assert len(method.points) == len(SHARPENINGS)
    assert len(method.scaled) == len(GAINS)


def test_the_picture_reaches_above_every_lively_point():
    still, lively, wild = point(1.0, 0.1), point(5.0, 1.0, sharpening=2.0), point(9.0, 1.7, sharpening=2.0)
    assert 5 < highest_shown([Curve("x", (still, lively, wild))], "lve") < 9
    assert highest_shown([Curve("x", (still, wild))], "lve") == pytest.approx(1.25)


def test_the_picture_holds_every_curve():
    rows = mean_points([compromises(talk(size=0.9), talk())])
    names = [f"m{k}" for k in range(20)]
    few = curve_figure(curves_of({"m": rows, "mean face": rows}, ()), ("mean face",), "mm", colour_of(["m", "mean face"]))
    many = curve_figure(curves_of(dict.fromkeys(names, rows), ()), (), "mm", colour_of(names))
    assert few.startswith("data:image/svg+xml;base64,")
    assert len(many) > len(few)
