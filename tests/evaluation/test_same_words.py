import numpy as np
import pytest
from corpora import tiny_corpus
from talking_points import FPS, face, phones

from facesynth.corpus import Utterance
from facesynth.evaluation.pair import UnavailableError
from facesynth.evaluation.same_words import SaidWord, said_words, same_words
from facesynth.inference.speech import EmotionTrack, Speech
from facesynth.speech.textgrid import write_textgrid


@pytest.fixture
def corpus(tmp_path):
    """Each utterance has two words: its first half and its second."""
    made = tiny_corpus(tmp_path / "corpus", utterances=4)
    for name in made.ids:
        phones = made[name].speech.phones
        half, end = float(phones.ends_s[len(phones) // 2]), phones.duration_s
        write_textgrid(made.files.phones(name), phones, [("Now", 0.1, half), ("then", half, end)])
    return made


def take(name, gap, track):
    speech = Speech(np.zeros(100), 1000, track, EmotionTrack.constant("neutral", track.duration_s))
    return Utterance(name, speech, face(gap), "s", 1, "p")


def opening(motion):
    return motion.points[:, 5, 1] - motion.points[:, 7, 1]


def test_words_stand_between_their_neighbours(corpus):
    first, second = said_words(corpus, corpus.ids[0])
    assert [(w.before, w.word, w.after) for w in (first, second)] == [("", "now", "then"), ("now", "then", "")]
    assert first.end_s == pytest.approx(second.start_s, abs=1e-6)


def test_a_word_is_stretched_phone_by_phone_and_pauses_are_as_long_as_they_are():
    theirs = phones(("pau", 0.2), ("aa", 0.6), ("m", 1.0), ("pau", 1.2))
    mine = phones(("pau", 0.5), ("aa", 0.7), ("m", 1.5), ("pau", 1.7))
    ramp = np.arange(72) / FPS  # the opening is the time in the other recording
    other, this = take("other", ramp, theirs), take("this", np.zeros(102), mine)
    own, its = SaidWord("this", "", "am", "", 0.5, 1.5), SaidWord("other", "", "am", "", 0.2, 1.0)
    again = same_words(this, [own], {"other": other}, [its])
    assert len(again) == 102
    assert opening(again)[[30, 42, 66, 90]] == pytest.approx([0.2, 0.6, 0.8, 1.0], abs=1e-3)
    assert opening(again)[[18, 96]] == pytest.approx([0.0, 1.1], abs=1e-3)


def test_the_word_between_the_same_words_is_taken_then_the_one_that_lasts_as_long():
    word = SaidWord("this", "bin", "blue", "at", 1.0, 1.3)
    alone, far, near = (
        SaidWord(f"{k}", "bin", "blue", after, 0.0, s) for k, after, s in ((0, "by", 0.3), (1, "at", 0.6), (2, "at", 0.4))
    )
    assert max((alone, far, near), key=word.likeness) is near


def test_nobody_is_compared_with_the_recording_itself(corpus):
    this = corpus[corpus.ids[0]]
    own = said_words(corpus, this.id)
    with pytest.raises(UnavailableError, match="no other recording says 'now'"):
        same_words(this, own, corpus, own)
