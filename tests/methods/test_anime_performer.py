"""The anime graph on the built-in performer: what its maps, its filters and its closures are worth on sentences left out."""

import runpy
from itertools import permutations

import numpy as np
import pytest

from facesynth.inference.anime_graph.lowpass import LowPass
from facesynth.inference.lips import bilabial_spans, lip_gap
from facesynth.methods.anime_graph.lowpass import energy_spectrum
from facesynth.methods.anime_graph.method import AnimeGraph
from facesynth.methods.anime_graph.parallel import take_of
from facesynth.methods.anime_graph.report import MapTrial, learner

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def split(performer):
    """Sentences to learn from, and others."""
    return performer.split(0)


@pytest.fixture(scope="module")
def model(split):
    return AnimeGraph().fit(split[0])


def test_maps_come_nearer_than_nothing_and_than_the_mean_difference(performer, model):
    takes = [take for take in (take_of(u, model.components) for u in performer) if take is not None]
    trial = MapTrial(takes, performer.layout, learner(performer.layout, variance=0.98))
    for pair in permutations(performer.emotions, 2):
        score = trial.score(*pair, folds=5)
        assert score.sentences >= 15
        assert score.helps("exponential cross-validated"), score
        assert score.mapped["exponential cross-validated"] < 1.02 * score.mapped[score.best], score


def test_where_a_rotation_mixes_speech_into_every_component_maps_come_nearer_all_the_same(performer, model, repository):
    rotated = runpy.run_path(str(repository / "benchmarks" / "emotion_maps.py"))["rotated"]
    takes = [take for take in (take_of(u, model.components) for u in performer) if take is not None]
    way = rotated(learner(performer.layout, variance=0.98), performer, 0)
    trial = MapTrial(takes, performer.layout, way, kinds=("exponential cross-validated",)).with_sentences(20)
    assert trial.without().split.mixed
    for pair in permutations(performer.emotions, 2):
        score = trial.score(*pair, folds=3)
        assert score.helps("exponential cross-validated"), score


def test_lips_still_close_in_every_other_emotion(split, model):
    held_out = list(split[1])

    def narrowest(utterance, motion):
        gap = lip_gap(motion)
        return [np.nanmin(gap[a:b]) for a, b in bilabial_spans(utterance.speech.phones, model.fps) if b > a]

    recorded = np.concatenate([narrowest(u, u.motion) for u in held_out])
    closed = np.nanpercentile(recorded, 90)
    for target in model.emotions:
        others = [u for u in held_out if u.emotion != target]
        before = np.concatenate([narrowest(u, u.motion) for u in others]) <= closed
        after = np.concatenate([narrowest(u, model.map_emotion(u.motion, u.emotion, target)) for u in others]) <= closed
        assert after.mean() >= before.mean() - 0.05, target


def test_no_component_holds_energy_above_its_cut_off(split, model):
    cutoffs_hz = model.cutoffs_hz.numpy()
    low_pass = LowPass(cutoffs_hz, model.fps)
    smooth, kept, captured = [], 0.0, 0.0
    for utterance in split[1]:
        blended = model.runtime().joined(model.plan(utterance.speech))
        smooth.append(low_pass(blended))
        complete = utterance.motion.frames[np.isfinite(utterance.motion.frames).all(axis=1)]
        motion = model.components.encode_array(complete)
        kept = kept + np.square(low_pass(motion) - motion.mean(axis=0)).sum(axis=0)
        captured = captured + np.square(motion - motion.mean(axis=0)).sum(axis=0)
    frequencies, energy = energy_spectrum(smooth, model.fps)
    above = (energy * (frequencies[:, None] > cutoffs_hz)).sum(axis=0) / energy.sum(axis=0)
    assert above.max() <= 0.01
    assert (kept / captured).min() >= 0.95
