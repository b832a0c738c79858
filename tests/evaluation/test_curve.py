"""The curve of error against motion: its points, its best ones, and what sharpening does to any motion."""

from dataclasses import replace

import numpy as np
import pytest
from corpora import tiny_corpus

from facesynth.evaluation.curve import Curve, Point, curve, efase_variants, sharpened
from facesynth.evaluation.dynamics import energy_ratio
from facesynth.evaluation.geometry import lve
from facesynth.methods.baselines.mean_face import MeanFace
from facesynth.methods.baselines.phone_mean import PhoneMean
from facesynth.methods.efase.method import Efase
from facesynth.methods.method import Method


class Playback(Method):
    """Says every utterance of a corpus as it was recorded, its movement times `size`."""

    name = "playback"

    def __init__(self, corpus, size=1.0):
        super().__init__()
        self.known = list(corpus)
        self.size = size

    def synthesize(self, speech, *, seed=0):
        motion = next(u.motion for u in self.known if same(u.speech, speech))
        mean = motion.frames.mean(axis=0)
        return replace(motion, frames=(mean + self.size * (motion.frames - mean)).astype(np.float32))


def same(one, other):
    return len(one.audio) == len(other.audio) and np.array_equal(one.audio, other.audio)


@pytest.fixture(scope="module")
def halves(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("curve") / "corpus", utterances=20, fps=60).split(0)


def point(error, energy):
    return Point("", 0.0, error, error, energy, energy)


def test_the_front_holds_what_nothing_beats():
    good, lively, worse, wild = point(1.5, 0.6), point(1.7, 0.95), point(1.8, 0.9), point(2.0, 1.5)
    drawn = Curve("x", (wild, worse, lively, good))
    assert drawn.front == (good, lively)
    assert drawn.nearest is good
    assert drawn.lively is lively
    assert Curve("x", (good, wild)).lively is None
    assert len(drawn.rows()) == 4
    assert drawn.rows()[0] == {"method": "x", **wild.__dict__}


def test_the_points_are_the_means_of_the_metrics(halves):
    train, test = halves
    model = PhoneMean().fit(train)
    drawn = curve("phone mean", {"as it is": lambda: model}, test, sharpenings=(0.0, 1.0))
    made = [(model.synthesize(u.speech), u.motion) for u in test]
    assert [p.sharpening for p in drawn.points] == [0.0, 1.0]
    assert drawn.points[0].lve == pytest.approx(np.mean([lve(x, y) for x, y in made]), rel=1e-6)
    assert drawn.points[0].energy_ratio == pytest.approx(np.mean([energy_ratio(x, y) for x, y in made]), rel=1e-6)
    assert drawn.points[1].energy_ratio == pytest.approx(np.mean([energy_ratio(sharpened(x, 1.0), y) for x, y in made]), rel=1e-6)
    assert drawn.points[1].energy_ratio > drawn.points[0].energy_ratio


def test_a_motion_that_is_made_smaller_lies_at_lower_energy_and_larger_error(halves):
    test = halves[1].subset(halves[1].ids[:2])
    sizes = {f"{size:g}": (lambda size=size: Playback(test, size)) for size in (1.0, 0.8, 0.5)}
    drawn = curve("playback", sizes, test, sharpenings=(0.0,))
    assert drawn.points[0].lve == pytest.approx(0, abs=1e-5)
    np.testing.assert_allclose([p.energy_ratio for p in drawn.points], [1, 0.8, 0.5], rtol=1e-4)
    np.testing.assert_allclose([p.lip_energy_ratio for p in drawn.points], [1, 0.8, 0.5], rtol=1e-4)
    assert drawn.points[0].lve < drawn.points[1].lve < drawn.points[2].lve


def test_a_still_face_gains_nothing_by_sharpening(halves):
    model = MeanFace().fit(halves[0])
    points = curve("mean face", {"": lambda: model}, halves[1], sharpenings=(0.0, 2.0)).points
    assert points[0].energy_ratio == pytest.approx(0, abs=1e-6)
    assert points[1].lve == pytest.approx(points[0].lve, rel=1e-5)


def test_efase_is_drawn_over_its_temperature(halves):
    model = Efase(candidates=20).fit(halves[0])
    variants = efase_variants(model, (0.0, 3.0))
    assert list(variants) == ["temperature 0", "temperature 3"]
    cold, hot = curve("efase", variants, halves[1], sharpenings=(0.0,)).points
    assert hot.energy_ratio < cold.energy_ratio
