import json
import subprocess
import sys

import numpy as np
import pytest
from acting import phones_of

from facesynth.inference.errors import FacesynthError
from facesynth.performer import voice as voice_room
from facesynth.performer.lines import DEMO_LINES, speak_lines
from facesynth.performer.prosody import EMOTIONS, analyse, colour
from facesynth.performer.script import load_script
from facesynth.performer.voice import speak

SENTENCE = "She put a huge yellow cushion on the couch by the fire."


@pytest.fixture
def calm(voice):
    return analyse(*speak([SENTENCE])[0])


def level_db(audio):
    return 20 * np.log10(np.sqrt(np.mean(audio.astype(np.float64) ** 2)))


def test_the_voice_says_the_same_bytes_every_time(voice, monkeypatch, tmp_path):
    first = speak([SENTENCE, "Good morning."])
    monkeypatch.setenv("FACESYNTH_CACHE", str(tmp_path))
    again = speak(["Good morning.", SENTENCE])
    assert first[0][1] == 22050
    assert first[0][0].tobytes() == again[1][0].tobytes()
    assert first[1][0].tobytes() == again[0][0].tobytes()
    assert len(first[0][0]) > len(first[1][0])


def test_what_was_said_once_is_kept(voice, monkeypatch):
    speak([SENTENCE])
    monkeypatch.setattr(voice_room, "_run", lambda *_: pytest.fail("said again"))
    speak([SENTENCE])


def test_a_voice_that_fails_says_why_and_keeps_nothing(voice, monkeypatch, tmp_path):
    monkeypatch.setenv("FACESYNTH_CACHE", str(tmp_path))
    (tmp_path / "broken.onnx").write_bytes(b"no voice")
    monkeypatch.setattr(voice_room, "voice_path", lambda: tmp_path / "broken.onnx")
    with pytest.raises(FacesynthError, match=r"piper said 0 of 1 sentences: \w+"):
        speak(["Hello."])
    assert not list(tmp_path.rglob("*.wav"))


def test_nothing_to_say_is_refused(voice):
    with pytest.raises(FacesynthError, match="nothing to say"):
        speak(["Hello.", " ?! "])


def test_a_missing_voice_names_the_extra(monkeypatch):
    monkeypatch.setattr(voice_room.importlib.util, "find_spec", lambda _: None)
    voice_room.voice_path.cache_clear()
    with pytest.raises(FacesynthError, match=r"facesynth\[demo\]"):
        speak(["Hello."])
    voice_room.voice_path.cache_clear()


def test_piper_is_never_imported(voice):
    code = (
        "import sys, json; import facesynth.performer.build, facesynth.performer.lines as lines;"
        "lines.speak(['Hello.']); print(json.dumps([m for m in sys.modules if m.split('.')[0] in ('piper', 'torch')]))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == []


def test_emotions_sound_as_they_should(calm):
    voiced = {emotion: colour(calm, emotion, 0) for emotion in EMOTIONS}
    median = {emotion: np.median(v.pitch_hz[v.pitch_hz > 0]) for emotion, v in voiced.items()}
    spread = {emotion: np.log(v.pitch_hz[v.pitch_hz > 0]).std() for emotion, v in voiced.items()}
    loud = {emotion: level_db(v.audio) for emotion, v in voiced.items()}
    assert median["happy"] > 1.1 * median["neutral"] > 1.1 * median["sad"]
    assert spread["happy"] > 1.2 * spread["neutral"] > 1.5 * spread["sad"]
    assert loud["angry"] > loud["happy"] > loud["neutral"] > loud["sad"]
    assert len(voiced["sad"].audio) > 1.1 * len(voiced["neutral"].audio) > 1.1 * len(voiced["angry"].audio)


def test_takes_differ_and_seeds_repeat(calm):
    one, same, other = (colour(calm, "happy", seed) for seed in (1, 1, 2))
    assert one.audio.tobytes() == same.audio.tobytes()
    assert len(one.audio) != len(other.audio)
    assert 0.85 < len(one.audio) / len(other.audio) < 1.15


def test_sound_stays_within_full_scale(calm):
    for emotion in EMOTIONS:
        audio = colour(calm, emotion, 5).audio
        assert np.isfinite(audio).all()
        assert np.abs(audio).max() < 1.0


def test_pitch_runs_along_the_sound(calm):
    voiced = colour(calm, "sad", 0)
    assert len(voiced.pitch_hz) * 0.005 == pytest.approx(len(voiced.audio) / voiced.rate, abs=0.02)


def test_an_unknown_emotion_is_refused(calm):
    with pytest.raises(FacesynthError, match="did you mean happy"):
        colour(calm, "hapy", 0)


def test_silence_has_no_pitch_and_stays_quiet(voice):
    quiet = colour(analyse(np.zeros(22050, np.float32), 22050), "angry", 0)
    assert level_db(quiet.audio) < -40


def test_the_demo_sentence_is_new_and_goes_through_three_emotions(voice):
    spoken = speak_lines(DEMO_LINES)
    assert len(spoken.audio) / spoken.rate >= 10
    assert spoken.emotions.labels == ("happy", "angry", "sad")
    assert spoken.emotions.ends_s[-1] == pytest.approx(len(spoken.audio) / spoken.rate)
    assert {sentence.text for sentence in load_script("full")}.isdisjoint(text for text, _ in DEMO_LINES)
    assert len(phones_of(spoken.text)) > 80
    assert spoken.audio.tobytes() == speak_lines(DEMO_LINES).audio.tobytes()


def test_no_lines_are_refused():
    with pytest.raises(FacesynthError, match="no lines"):
        speak_lines([])
