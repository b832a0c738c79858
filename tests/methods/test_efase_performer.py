"""eFASE on the built-in performer's small script: the optimum, the emotions, the closures."""

import numpy as np
import pytest

from facesynth.evaluation.emotion_recognition import EmotionRecogniser
from facesynth.evaluation.lips import closure_rate, closure_threshold, false_closure_rate
from facesynth.inference.efase.costs import all_targets
from facesynth.methods.efase.method import Efase
from facesynth.methods.efase.torch_search import torch_engine

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def halves(performer):
    return performer.split(0)


@pytest.fixture(scope="module")
def model(halves):
    return Efase().fit(halves[0])


@pytest.fixture(scope="module")
def spoken(model, halves):
    return [(utterance, model.synthesize(utterance.speech)) for utterance in halves[1]]


def test_both_engines_find_the_optimum(model, halves):
    nodes, weights = model.nodes(), model.weights()
    by_tensors = torch_engine(nodes, weights)
    for utterance in list(halves[1])[:4]:
        query = model.plan(utterance.speech).query
        targets = all_targets(nodes, query, weights)
        np.testing.assert_array_equal(by_tensors(targets), model.speaker.index.cheapest_path(targets))


def test_the_asked_emotion_is_recognised_in_what_is_said(halves, spoken):
    recogniser = EmotionRecogniser.fit(halves[0])
    right = [recogniser.recognise(motion) == utterance.speech.emotions.labels[0] for utterance, motion in spoken]
    assert np.mean(right) >= 0.8


def test_lips_close_where_they_should_and_nowhere_else(halves, spoken):
    threshold = closure_threshold((u.motion, u.speech.phones) for u in halves[0])
    said = [(motion, u.speech.phones) for u, motion in spoken if {"p", "b", "m"} & set(u.speech.phones.labels)]
    assert np.mean([closure_rate(motion, phones, threshold) for motion, phones in said]) >= 0.9
    assert np.mean([false_closure_rate(motion, phones, threshold) for motion, phones in said]) <= 0.1
