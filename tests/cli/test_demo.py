"""The demo begins with one sentence of the model that comes with facesynth."""

import numpy as np

from facesynth.cli.demo import _first_sentence
from facesynth.inference.speech import EmotionTrack, PhoneTrack, Speech


def test_the_first_sentence_ends_where_the_first_emotion_does():
    phones = PhoneTrack(("m", "aa", "pau", "b"), np.array([0.2, 0.5, 0.9, 1.5]))
    emotions = EmotionTrack(("happy", "sad"), np.array([0.7, 1.5]), np.ones(2))
    first = _first_sentence(Speech(np.arange(24000) / 24000, 16000, phones, emotions), "neutral")
    assert (first.phones.labels, first.phones.ends_s.tolist()) == (("m", "aa", "pau"), [0.2, 0.5, 0.7])
    assert (len(first.audio), first.duration_s) == (11200, 0.7)
    assert (first.emotions.labels, first.emotions.ends_s.tolist()) == (("neutral",), [0.7])
