import numpy as np
import pytest
from corpora import tiny_corpus
from talking_points import FPS, face, phones

from facesynth.corpus import Utterance
from facesynth.evaluation.second_take import retimed, second_take
from facesynth.inference.motion import Motion
from facesynth.inference.speech import EmotionTrack, Speech


def take(gap, track):
    speech = Speech(np.zeros(100), 1000, track, EmotionTrack.constant("neutral", track.duration_s))
    return Utterance("u", speech, face(gap), "s", 2, "p")


def opening(motion):
    return motion.points[:, 5, 1] - motion.points[:, 7, 1]


def test_the_same_timing_changes_nothing():
    track = phones(("pau", 0.3), ("aa", 0.7), ("m", 1.0))
    this = take(5 + np.sin(np.arange(60) / 5), track)
    assert retimed(this, track).frames == pytest.approx(this.motion.frames, abs=1e-4)


def test_phones_start_where_the_other_s_do():
    theirs = phones(("pau", 0.2), ("aa", 0.6), ("m", 1.0))
    mine = phones(("pau", 0.5), ("aa", 0.7), ("m", 1.5))
    ramp = np.arange(60) / FPS  # the opening is the time in the take
    moved = retimed(take(ramp, theirs), mine)
    assert len(moved) == 90
    assert opening(moved)[[0, 30, 42]] == pytest.approx([0, 0.2, 0.6], abs=1e-3)
    assert np.all(np.diff(opening(moved)) >= -1e-4)


def test_a_phone_that_one_take_lacks_lies_between_its_neighbours():
    theirs, mine = phones(("aa", 0.4), ("m", 1.0)), phones(("aa", 0.4), ("t", 0.5), ("m", 1.1))
    moved = retimed(take(np.arange(60) / FPS, theirs), mine)
    assert len(moved) == 66
    assert opening(moved)[[24, 30, 60]] == pytest.approx([0.4, 0.4, 0.9], abs=1e-3)


def test_missing_samples_of_the_take_are_bridged():
    track = phones(("aa", 1.0))
    this = take(np.full(60, 4.0), track)
    frames = this.motion.frames.copy()
    frames[20:50, 22] = np.nan
    holes = Utterance("u", this.speech, Motion(frames, FPS, this.motion.layout), "s", 2, "p")
    assert retimed(holes, track).frames == pytest.approx(this.motion.frames, abs=1e-4)


def test_a_second_take_is_of_the_same_words_and_emotion(tmp_path):
    corpus = tiny_corpus(tmp_path / "corpus", utterances=8, fps=30)
    other = second_take(corpus, "s00_neutral_t1")
    assert other is not None
    assert other.id == "s00_neutral_t2"
    assert second_take(corpus, "s00_neutral_t2").id == "s00_neutral_t1"
    assert second_take(corpus, "s00_happy_t1") is None
    assert second_take(corpus.subset(["s00_neutral_t1", "s00_happy_t1"]), "s00_neutral_t1") is None
