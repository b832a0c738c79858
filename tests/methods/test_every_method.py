"""What everybody may expect of any method, whatever it is."""

from dataclasses import replace

import numpy as np
import pytest
from every_method import METHODS

from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion
from facesynth.inference.speech import EmotionTrack, PhoneTrack, Speech
from facesynth.methods.registry import create, load


@pytest.fixture(params=METHODS)
def name(request):
    return request.param


@pytest.fixture
def method(name, all_trained):
    return all_trained[name]


def saying(*pairs):
    """Speech of (phone, end in s) pairs, with a hum for sound."""
    track = PhoneTrack(tuple(phone for phone, _ in pairs), np.array([end for _, end in pairs]))
    audio = 0.1 * np.sin(np.arange(round(track.duration_s * 16000)) / 20)
    return Speech(audio, 16000, track, EmotionTrack.constant("neutral", track.duration_s))


def assert_same(one: Motion, other: Motion):
    for part in ("frames", "head", "eyes"):
        np.testing.assert_array_equal(getattr(one, part), getattr(other, part))


def test_motion_is_as_long_as_the_phones_and_complete(method, tiny):
    for speech in (tiny[tiny.ids[0]].speech, saying(("pau", 0.4), ("aa", 0.613), ("p", 0.7)), saying(("m", 0.1))):
        motion = method.synthesize(speech)
        assert (motion.layout, motion.fps) == (tiny.layout, tiny.fps)
        assert len(motion) == round(speech.duration_s * tiny.fps)
        assert all(np.isfinite(part).all() for part in (motion.frames, motion.head, motion.eyes) if part is not None)


def test_the_same_seed_says_the_same(method, tiny):
    speech = tiny[tiny.ids[1]].speech
    assert_same(method.synthesize(speech, seed=3), method.synthesize(speech, seed=3))


def test_a_saved_method_says_the_same(method, tiny, tmp_path):
    speech = tiny[tiny.ids[1]].speech
    method.save(tmp_path / "model.safetensors")
    assert_same(load(tmp_path / "model.safetensors").synthesize(speech), method.synthesize(speech))


def test_one_that_must_be_told_what_is_said_refuses_speech_of_which_nobody_knows_it(method, tiny):
    given = tiny[tiny.ids[0]].speech
    felt = EmotionTrack.constant("happy", given.duration_s)
    speech = replace(given, phones=PhoneTrack.unknown(given.duration_s), emotions=felt)
    if method.needs_phones:
        with pytest.raises(FacesynthError, match="must be told what is said"):
            method.synthesize(speech)
    else:
        assert len(method.synthesize(speech)) == round(speech.duration_s * tiny.fps)


def test_an_option_that_it_has_not_is_refused_by_name(method, tiny):
    with pytest.raises(FacesynthError, match=rf"{method.name}.*temperature"):
        method.synthesize(tiny[tiny.ids[0]].speech, temperature=1.0)


def test_an_untrained_method_says_so(name, tiny, tmp_path):
    untrained = create(name, **METHODS[name])
    for use in (lambda: untrained.synthesize(tiny[tiny.ids[0]].speech), lambda: untrained.save(tmp_path / "model")):
        with pytest.raises(FacesynthError, match="not trained"):
            use()


def test_an_empty_corpus_is_refused(name, tiny):
    with pytest.raises(FacesynthError, match="no usable utterance"):
        create(name, **METHODS[name]).fit(tiny.subset([]))
