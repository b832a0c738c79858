"""What an emotion adds to a neutral face, apart from what is said."""

import re
import runpy
from dataclasses import replace

import numpy as np
import pytest
from corpora import twin_corpus

from facesynth.corpus import Corpus, Record
from facesynth.inference.errors import FacesynthError
from facesynth.inference.expression import patch_settings
from facesynth.inference.layout import Layout
from facesynth.inference.lips import gap
from facesynth.inference.motion import Motion
from facesynth.inference.phones import VOWELS
from facesynth.inference.speech import EmotionTrack, PhoneTrack
from facesynth.methods.expression.differences import difference_of, says_the_same, times_in, whole_runs
from facesynth.methods.expression.method import Expression
from facesynth.methods.registry import load
from facesynth.motion.resample import resample

FPS = 60


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return twin_corpus(tmp_path_factory.mktemp("twins") / "corpus")


@pytest.fixture(scope="module")
def model(corpus):
    return Expression().fit(corpus)


def neutral_of(corpus, emotion="happy", intensity=1.0):
    """A neutral motion, and its speech in an emotion."""
    one = next(u for u in corpus if u.emotion == "neutral")
    return one.motion, replace(one.speech, emotions=EmotionTrack.constant(emotion, one.speech.duration_s, intensity))


def test_the_difference_is_what_was_added_and_lids_are_left_out(corpus):
    neutral, happy = (next(u for u in corpus if (u.sentence, u.emotion) == ("s00", e)) for e in ("neutral", "happy"))
    found = difference_of(neutral, happy)
    layout = corpus.layout
    brows = layout.columns("brows")[1::3]
    assert found.frames[:, brows] == pytest.approx(happy.motion.frames[:, brows] - neutral.motion.frames[:, brows], abs=1e-3)
    assert not found.frames[:, layout.columns("eyelids")].any()


def test_phones_are_warped_to_where_they_are_said_in_the_other_recording():
    own = PhoneTrack(("pau", "aa", "m", "iy", "pau"), np.array([0.2, 0.4, 0.5, 0.8, 1.0]))
    other = PhoneTrack(("pau", "aa", "m", "pau", "iy", "pau"), np.array([0.1, 0.5, 0.7, 0.9, 1.5, 1.6]))
    assert says_the_same(own, other)
    assert not says_the_same(own, PhoneTrack(("aa", "m"), np.array([0.1, 0.2])))
    asked = np.array([0.0, 0.1, 0.2, 0.3, 0.45, 0.65, 1.0])
    assert times_in(other, own, asked) == pytest.approx([0, 0.05, 0.1, 0.3, 0.6, 1.2, 1.6], abs=1e-4)
    assert (np.diff(times_in(other, own, np.linspace(0, 1, 200))) >= 0).all()


def test_speech_that_is_slower_in_an_emotion_leaves_nothing_in_the_difference(tmp_path):
    def slowly(speech, motion):
        slow = resample(Motion(motion.frames, FPS / 1.5, motion.layout), FPS)
        phones = PhoneTrack(speech.phones.labels, 1.5 * speech.phones.ends_s)
        count = phones.frame_bounds(FPS)[-1]
        at = np.minimum(np.arange(count), len(slow) - 1)
        audio = np.zeros(round(phones.duration_s * speech.sample_rate), np.float32)
        emotions = EmotionTrack.constant(speech.emotions.labels[0], phones.duration_s)
        return replace(speech, audio=audio, phones=phones, emotions=emotions), Motion(slow.frames[at], FPS, motion.layout)

    corpus = twin_corpus(tmp_path / "slow", sentences=3, shift=slowly)
    neutral, happy = (next(u for u in corpus if (u.sentence, u.emotion) == ("s00", e)) for e in ("neutral", "happy"))
    chin = corpus.layout.columns("jaw")
    assert np.abs(difference_of(neutral, happy).frames[:, chin]).mean() < 0.1 * neutral.motion.frames[:, chin].std(axis=0).max()


SPOKEN = PhoneTrack(("pau", "aa", "m", "iy", "pau"), np.array([2.0, 4.0, 6.0, 8.0, 10.0]))


def test_as_in_the_dissertation_signals_are_grown_whole_of_recorded_ones(corpus, model):
    whole = Expression(3, 0.25, 5 / 120, 0.03, context=False, variety=1.0).fit(corpus)
    assert not whole.weights.any()
    assert not whole.constants.any()
    assert whole.facts["told_by_phones"] == 0
    brows = whole.fitted_layout.columns("brows")[1::3]
    for emotion, size in (("happy", 4.0), ("sad", -3.0)):
        signal = whole.speaker().signal(emotion, SPOKEN, 600)
        assert np.array_equal(signal, whole.speaker().grow(emotion, 600).frames)
        brow = whole.decode_array(signal.astype(np.float32))[:, brows]
        assert brow.mean() == pytest.approx(size, abs=0.5)
        assert brow.std() == pytest.approx(np.sqrt(0.5), rel=0.5)


def raised_at_vowels(speech, motion):
    """Brows go up by 3 mm at vowels, and by another 2 mm at the beginning."""
    frames, at = motion.frames.copy(), speech.phones.frame_bounds(motion.fps)
    vowels = np.repeat([label in VOWELS for label in speech.phones.labels], np.diff(at))[: len(frames)]
    rise = 3 * vowels + 2 * np.exp(-motion.times_s / 0.5)
    frames[:, motion.layout.columns("brows")[1::3]] += rise[:, None]
    return speech, replace(motion, frames=frames)


def test_what_phones_tell_of_an_emotion_is_expected_and_the_rest_is_grown(tmp_path):
    corpus = twin_corpus(tmp_path / "vowels", sentences=12, shift=raised_at_vowels)
    left_out = [i for i in corpus.ids if i.startswith(("s00", "s05"))]
    model = Expression(variety=0.0).fit(corpus.subset([i for i in corpus.ids if i not in left_out]))
    assert model.facts["told_by_phones"] > 0.3
    brows = model.fitted_layout.columns("brows")[1::3]
    expected, added = [], []
    for happy in (corpus[i] for i in left_out if i.endswith("happy")):
        neutral = corpus[happy.id.replace("happy", "neutral")]
        signal = model.speaker().signal("happy", neutral.speech.phones, len(neutral.motion))
        expected.append(model.decode_array(signal.astype(np.float32))[:, brows].mean(axis=1))
        added.append((happy.motion.frames - neutral.motion.frames)[:, brows].mean(axis=1))
    expected, added = np.concatenate(expected), np.concatenate(added)
    assert np.corrcoef(expected, added)[0, 1] > 0.5
    assert np.std(added - expected) < 0.9 * np.std(added)
    # what variety is grown of, is about nothing
    rests = model.signals.numpy()
    assert np.abs(rests.mean(axis=0)).max() < 0.2 * rests.std()
    model.config["variety"] = 1.0
    grown = model.speaker().grow("happy", len(signal), seed=2).frames
    assert np.allclose(model.speaker().signal("happy", neutral.speech.phones, len(signal), seed=2), signal + grown)


def test_so_much_of_an_emotion_is_kept_as_was_asked_for(corpus, model):
    short = Expression(kept_s=3.0).fit(corpus)
    for number in range(2):
        kept = [int((m.owners == number).sum()) for m in (short, model)]
        assert 1 <= kept[0] < kept[1]
    assert len(short.signals) < 0.6 * len(model.signals)
    assert short.weights.equal(model.weights)


def test_the_eigenspace_holds_what_was_added(model):
    assert model.facts["variance"] > 0.97
    assert model.facts["expressions"] == ["happy", "sad"]
    brows = model.fitted_layout.columns("brows")[1::3]
    for emotion, size in (("happy", 4.0), ("sad", -3.0)):
        grown = model.decode_array(model.speaker().signal(emotion, SPOKEN, 600).astype(np.float32))[:, brows]
        assert grown.mean() == pytest.approx(size, abs=0.5)


def test_a_face_feels_what_the_speech_says_and_more_with_intensity(model, corpus):
    brows = corpus.layout.columns("brows")[1::3]
    raised = []
    for intensity in (0.25, 0.5, 1.0):
        motion, speech = neutral_of(corpus, intensity=intensity)
        raised.append(float((model.express(motion, speech).frames - motion.frames)[:, brows].mean()))
    assert raised == pytest.approx([raised[2] / 4, raised[2] / 2, raised[2]], abs=1e-3)
    assert raised[2] > 2.5


@pytest.mark.parametrize(("emotion", "intensity"), [("happy", 0.0), ("neutral", 1.0)])
def test_no_intensity_leaves_the_motion_as_it_is_to_the_byte(model, corpus, emotion, intensity):
    motion, speech = neutral_of(corpus, emotion, intensity)
    assert model.express(motion, speech).frames.tobytes() == motion.frames.tobytes()


def test_lips_that_were_shut_stay_shut(model, corpus):
    motion, speech = neutral_of(corpus, "sad")
    before, after = gap(motion.frames, corpus.layout), gap(model.express(motion, speech).frames, corpus.layout)
    shut = before < before.min() + 0.1 * np.ptp(before)
    assert shut.any()
    assert after[shut] == pytest.approx(before[shut], abs=1e-3)


def test_the_same_seed_feels_the_same_and_another_does_not(model, corpus):
    motion, speech = neutral_of(corpus)
    one, same, other = (model.express(motion, speech, seed=seed).frames for seed in (0, 0, 1))
    assert np.array_equal(one, same)
    assert not np.array_equal(one, other)


def test_motion_at_another_rate_is_given_the_same_signal(model, corpus):
    motion, speech = neutral_of(corpus)
    twice = resample(motion, 2 * FPS)
    added = model.express(motion, speech).frames - motion.frames
    fine = model.express(twice, speech).frames - twice.frames
    brows = corpus.layout.columns("brows")
    assert fine[::2][: len(added), brows] == pytest.approx(added[: len(fine[::2]), brows], abs=0.05)


def test_emotions_come_and_go_along_the_track(model, corpus):
    motion, speech = neutral_of(corpus)
    half = speech.duration_s / 2
    track = EmotionTrack(("neutral", "happy"), np.array([half, speech.duration_s]), np.array([1.0, 1.0]))
    added = np.abs(model.express(motion, replace(speech, emotions=track)).frames - motion.frames).max(axis=1)
    early = motion.times_s < half - 0.35
    assert not added[early].any()
    assert added[motion.times_s > half + 0.3].min() > 1


def test_a_face_that_says_nothing_feels_too(model, corpus):
    _, speech = neutral_of(corpus)
    motion = model.synthesize(speech)
    assert len(motion) == speech.phones.frame_bounds(FPS)[-1]
    assert (motion.frames - model.rest.numpy())[:, corpus.layout.columns("brows")[1::3]].mean() > 2.5


def test_a_saved_model_feels_the_same(model, corpus, tmp_path):
    model.save(tmp_path / "model.safetensors")
    motion, speech = neutral_of(corpus)
    loaded = load(tmp_path / "model.safetensors")
    assert loaded.emotions == ("neutral", "happy", "sad")
    assert np.array_equal(loaded.express(motion, speech).frames, model.express(motion, speech).frames)


def test_curves_stay_within_their_range(corpus, tmp_path):
    names = corpus.layout.names
    layout = Layout("curves", names)
    made = Corpus.create(tmp_path / "curves", performer="Curves", layout=layout, fps=FPS, emotions=corpus.emotions)
    for u in corpus:
        frames = np.clip(0.5 + (u.motion.points[..., 1] - np.array(corpus.layout.neutral).reshape(-1, 3)[:, 1]) / 9, 0, 1)
        made.add_utterance(Record(u.id, "", u.sentence, u.emotion), u.speech, Motion(frames, FPS, layout))
    made = Corpus.open(made.path)
    model = Expression().fit(made)
    motion, speech = neutral_of(made)
    frames = model.express(motion, speech).frames
    assert 0 <= frames.min() <= frames.max() <= 1
    assert not np.array_equal(frames, motion.frames)


def test_gaps_break_a_recording_in_two():
    frames = np.arange(10.0)[:, None].repeat(2, axis=1)
    frames[4, 0] = np.nan
    assert [len(run) for run in whole_runs(frames)] == [4, 5]


def test_lengths_of_patches_follow_the_rate():
    assert (patch_settings(120, 0.25, 5 / 120, 0.03).patch, patch_settings(120, 0.25, 5 / 120, 0.03).boundary) == (30, 5)
    assert (patch_settings(25, 0.25, 5 / 120, 0.03).patch, patch_settings(25, 0.25, 5 / 120, 0.03).boundary) == (6, 1)


def without(corpus, path, keep):
    """A corpus of some of the recordings."""
    made = Corpus.create(path, performer="Some", layout=corpus.layout, fps=FPS, emotions=corpus.emotions)
    for u in corpus:
        if keep(u):
            made.add_utterance(Record(u.id, "", u.sentence, u.emotion), u.speech, u.motion)
    return Corpus.open(path)


@pytest.mark.parametrize(
    ("keep", "word"),
    [
        (lambda u: u.emotion == "neutral", "in neutral alone"),
        (lambda u: u.emotion != "neutral", "no neutral recordings"),
        (lambda u: (u.emotion == "happy") == (u.sentence == "s00") and u.emotion != "sad", "happy has 0 sentences.*at least 2"),
        (lambda u: u.emotion == "neutral" or u.id == "s00_happy", "happy has 1 sentences"),
    ],
)
def test_corpora_that_teach_no_expression_are_refused_in_one_line(corpus, tmp_path, keep, word):
    with pytest.raises(FacesynthError, match=word) as told:
        Expression().fit(without(corpus, tmp_path / "some", keep))
    assert "\n" not in str(told.value)


def test_an_emotion_without_its_neutral_twin_is_left_out_and_told(corpus, tmp_path):
    some = without(corpus, tmp_path / "some", lambda u: u.emotion != "sad" or u.sentence == "s00")
    model = Expression().fit(some)
    assert model.emotions == ("neutral", "happy")
    assert "sad has 1 sentences" in model.facts["emotions_left_out"]["sad"]
    motion, speech = neutral_of(corpus, "sad")
    with pytest.raises(FacesynthError, match="'sad'"):
        model.express(motion, speech)


def test_motion_of_another_layout_and_settings_that_cannot_be_are_refused(model, corpus):
    _, speech = neutral_of(corpus)
    other = Motion(np.zeros((10, 2), np.float32), FPS, Layout("curves", ("a", "b")))
    with pytest.raises(FacesynthError, match="layout.*train both on one performer"):
        model.express(other, speech)
    with pytest.raises(FacesynthError, match="boundary_s < patch_s"):
        Expression(patch_s=0.1, boundary_s=0.2)


def test_the_training_script_learns_and_comes_nearer_to_the_emotion(corpus, repository, tmp_path, capsys):
    script = runpy.run_path(str(repository / "train" / "expression.py"))
    script["main"]([str(corpus.path), "-o", str(tmp_path / "made.safetensors"), "--seed", "1"])
    told = capsys.readouterr().out
    before, after = map(float, re.findall(r"emotion: ([\d.]+) mm in neutral, ([\d.]+) with", told)[0])
    assert after < 0.6 * before
    assert load(tmp_path / "made.safetensors").config["components"] == 0.995
