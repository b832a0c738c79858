"""eFASE on the built-in performer's small script: the optimum, the emotions, the closures."""

import numpy as np
import pytest
import torch

from facesynth.evaluation.emotion_recognition import EmotionRecogniser
from facesynth.evaluation.lips import closure_rate, closure_threshold, false_closure_rate
from facesynth.inference.efase.costs import all_targets
from facesynth.inference.efase.steps import path_cost
from facesynth.methods.efase.dense import dense_search, transition_matrix
from facesynth.methods.efase.method import Efase

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


def test_the_path_is_the_optimum_of_the_dense_matrix(model, halves):
    nodes, weights = model.nodes(), model.weights()
    transitions = transition_matrix(nodes, weights, "cpu", torch.float64)
    for utterance in list(halves[1])[:4]:
        query = model.plan(utterance.speech).query
        targets = all_targets(nodes, query, weights)
        paths = dense_search(targets, transitions), model.speaker.index.cheapest_path(targets)
        dense, sparse = (path_cost(nodes, query, path, weights) for path in paths)
        np.testing.assert_allclose(sparse, dense, rtol=1e-7)


def test_the_asked_emotion_is_recognised_in_what_is_said(halves, spoken):
    recogniser = EmotionRecogniser.fit(halves[0])
    right = [recogniser.recognise(motion) == utterance.speech.emotions.labels[0] for utterance, motion in spoken]
    assert np.mean(right) >= 0.8


def test_lips_close_where_they_should_and_nowhere_else(halves, spoken):
    threshold = closure_threshold((u.motion, u.speech.phones) for u in halves[0])
    said = [(motion, u.speech.phones) for u, motion in spoken if {"p", "b", "m"} & set(u.speech.phones.labels)]
    assert np.mean([closure_rate(motion, phones, threshold) for motion, phones in said]) >= 0.9
    assert np.mean([false_closure_rate(motion, phones, threshold) for motion, phones in said]) <= 0.1
