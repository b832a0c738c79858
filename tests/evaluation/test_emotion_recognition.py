import numpy as np
import pytest
from corpora import tiny_corpus

from facesynth.evaluation.emotion_recognition import Confusion, EmotionRecogniser
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion


@pytest.fixture(scope="module")
def split(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("tiny") / "corpus", utterances=28, fps=30).split(seed=1, test_share=0.3)


def test_it_tells_recorded_emotions_of_other_sentences(split):
    train, test = split
    recogniser = EmotionRecogniser.fit(train)
    assert recogniser.emotions == ("angry", "happy", "neutral", "sad")
    confusion = Confusion.of([u.emotion for u in test], [recogniser.recognise(u.motion) for u in test])
    assert confusion.accuracy >= 0.9


def test_it_says_the_same_every_time_and_bears_missing_frames(split):
    train, test = split
    motion = test[test.ids[0]].motion
    frames = motion.frames.copy()
    frames[3:9, 5] = np.nan
    answers = [EmotionRecogniser.fit(train).recognise(m) for m in (motion, motion, Motion(frames, 30, motion.layout))]
    assert len(set(answers)) == 1
    with pytest.raises(FacesynthError, match="fill its gaps"):
        EmotionRecogniser.fit(train).recognise(Motion(np.full_like(frames, np.nan), 30, motion.layout))


def test_one_emotion_is_nothing_to_tell_apart(split):
    happy = [u.id for u in split[0] if u.emotion == "happy"]
    with pytest.raises(FacesynthError, match=r"two of them; got \['happy'\]"):
        EmotionRecogniser.fit(split[0].subset(happy))


def test_confusion_accuracy_and_recall_are_the_textbook_s():
    confusion = Confusion.of(["a", "a", "a", "b", "c", "c"], ["a", "a", "b", "b", "a", "a"])
    assert confusion.emotions == ("a", "b", "c")
    assert confusion.counts.tolist() == [[2, 1, 0], [0, 1, 0], [2, 0, 0]]
    assert confusion.accuracy == pytest.approx(3 / 6)
    assert confusion.unweighted_average_recall == pytest.approx((2 / 3 + 1 + 0) / 3)
    assert np.isnan(Confusion.of([], []).accuracy)
