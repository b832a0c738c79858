"""The viseme table: fixed shapes, cross-faded."""

import numpy as np
from corpora import tiny_corpus

from facesynth.inference.phones import SILENCE, viseme_of
from facesynth.inference.speech import PhoneTrack
from facesynth.methods.baselines.viseme_table import FADE_S, VisemeTable, cross_fades

TRACK = PhoneTrack((SILENCE, "p", "aa", SILENCE), np.array([0.5, 0.6, 0.9, 1.4]))


def test_shares_sum_to_one_are_whole_in_the_middle_and_half_at_each_border():
    shown = cross_fades(TRACK, np.array([0.2, 0.5, 0.55, 0.6, 0.75, 0.9, 1.39]))
    np.testing.assert_allclose(shown.sum(axis=1), 1)
    expected = [[1, 0, 0, 0], [0.5, 0.5, 0, 0], [0, 1, 0, 0], [0, 0.5, 0.5, 0], [0, 0, 1, 0], [0, 0, 0.5, 0.5], [0, 0, 0, 1]]
    np.testing.assert_allclose(shown, expected, atol=1e-9)


def test_a_phone_shorter_than_a_fade_is_never_shown_whole_nor_less_than_nothing():
    short = PhoneTrack(("aa", "p", "aa"), np.array([0.5, 0.5 + FADE_S / 3, 1.0]))
    shown = cross_fades(short, np.linspace(0, 1, 400))
    assert shown.min() >= 0
    assert 0.2 < shown[:, 1].max() < 0.5


def test_every_phone_of_a_class_has_one_shape_and_a_class_never_recorded_rests(tmp_path):
    corpus = tiny_corpus(tmp_path / "corpus", utterances=6, fps=50)
    model = VisemeTable().fit(corpus)
    speech = corpus[corpus.ids[0]].speech
    shapes = model.shapes.numpy()
    heard = {viseme_of(label) for utterance in corpus for label in utterance.speech.phones.labels}
    for missing in set(range(len(shapes))) - heard:
        np.testing.assert_allclose(shapes[missing], shapes[viseme_of(SILENCE)], atol=1e-5)
    frames = model.synthesize(speech).frames
    assert np.all(frames.min(axis=0) >= shapes.min(axis=0) - 1e-4)
    assert np.all(frames.max(axis=0) <= shapes.max(axis=0) + 1e-4)
