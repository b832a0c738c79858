"""Heads and eyes by constants and by chance: as often and as far as recorded, and the same for the same seed."""

import numpy as np
import pytest
from corpora import tiny_corpus
from living_eyes import recording, with_eyes
from nodding import nodding_corpus

from facesynth.inference.errors import FacesynthError
from facesynth.methods.baselines.random_eyes import counted, random_eyes
from facesynth.methods.registry import create


def test_shifts_blinks_and_reach_are_counted():
    rates, reach = counted([recording(200.0, gain=0.0)])
    assert rates == pytest.approx([1.0, 0.5], rel=0.2)  # a place a second, of which a few are too near, and a blink every 2 s
    assert reach == pytest.approx([0.2, 0.2], rel=0.25)  # 95 % of a normal distribution of 0.1 rad


def test_random_eyes_have_the_rates_that_they_were_given():
    eyes = random_eyes(60 * 6000, 60.0, 0.5, np.array([0.2, 0.1]), 20.0, 0)
    moved = (np.diff(eyes[:, 1:], axis=0) != 0).any(axis=1).mean() * 60
    shut = (np.diff(eyes[:, 0]) < 0).mean() * 60 * 60
    assert moved == pytest.approx(2.0, rel=0.1)
    assert shut == pytest.approx(20.0, rel=0.1)
    assert np.abs(eyes[:, 1:]).max(axis=0) == pytest.approx([0.2, 0.1], rel=0.02)


def test_eyes_are_learned_and_nothing_to_learn_from_is_refused(tmp_path):
    corpus = with_eyes(tiny_corpus(tmp_path / "eyes", utterances=4, fps=60))
    model, speech = create("eyes_random").fit(corpus), corpus[corpus.ids[0]].speech
    made = model.synthesize(speech, seed=1)
    assert np.array_equal(made.eyes, model.synthesize(speech, seed=1).eyes)
    assert np.isfinite(made.eyes).all()
    with pytest.raises(FacesynthError, match="no recording has eyes"):
        counted([])


def test_a_head_sways_about_the_recorded_mean(tmp_path):
    corpus = nodding_corpus(tmp_path / "heads", 3)
    model = create("head_sway").fit(corpus)
    made = model.synthesize(corpus[corpus.ids[0]].speech, seed=2)
    away = np.degrees(made.head[:, :3] - model.pose.numpy()[:3])
    assert 0.3 < away.std() < 3
    assert not np.array_equal(made.head, model.synthesize(corpus[corpus.ids[0]].speech, seed=3).head)
