"""Sounds that are no speech: noise between sentences, breath, music, drums; lips rest, and nothing is said to music."""

import numpy as np
import pytest
from bringing import FPS, run, spoken
from scipy.signal import butter, sosfilt

from facesynth.inference.errors import FacesynthError
from facesynth.inference.spikes import Spike
from facesynth.speech.audio import save_wav
from facesynth.speech.recognition import speech_in

REST_S = 0.3
"""After speech lips are at rest within it."""


def noise(seconds, level_db, rate, seed=0):
    return np.random.default_rng(seed).normal(0, 10 ** (level_db / 20), round(seconds * rate))


def breath(seconds, rate):
    band = sosfilt(butter(2, [400, 3000], "band", fs=rate, output="sos"), noise(seconds, 0, rate, seed=1))
    return 0.03 * band * np.sin(np.pi * np.arange(len(band)) / len(band))


def music(seconds, rate):
    """Chords of plucked strings, two a second."""
    times_s = np.arange(rate // 2) / rate
    tones = [220, 262, 196, 247, 330, 294, 175, 220]
    partials = [(ratio, k) for ratio in (1, 1.25, 1.5) for k in (1, 2, 3, 4)]
    chords = [sum(np.sin(2 * np.pi * tone * r * k * times_s) / k for r, k in partials) * np.exp(-2 * times_s) for tone in tones]
    return 0.08 * np.concatenate([chords[k % len(chords)] for k in range(round(2 * seconds))])


def tune(seconds, rate):
    """Single notes of strings, four a second, over a chord: heard as phones, but in doubt."""
    times_s = np.arange(rate // 4) / rate
    notes = 220 * 2 ** (np.array([0, 3, 7, 10, 12, 10, 7, 3]) / 12)

    def played(hz):
        return sum(np.sin(2 * np.pi * hz * k * times_s) * np.exp(-3 * k * times_s) / k for k in range(1, 9))

    beats = [played(notes[k % 8]) + played(110.0) + played(165.0) for k in range(round(4 * seconds))]
    return 0.1 * np.concatenate(beats)


def drums(seconds, rate):
    beat = noise(0.25, -10, rate, seed=2) * np.exp(-40 * np.arange(round(0.25 * rate)) / rate)
    return np.tile(beat, round(4 * seconds))


@pytest.fixture(scope="module")
def sentences(voice):
    """Two sentences of the built-in performer's voice, and their rate."""
    from facesynth.performer.voice import speak

    (first, rate), (second, _) = speak(["The boat moved up and down.", "My brother bought a map."])
    return first, second, rate


def test_lips_rest_between_sentences_whatever_is_heard_there(tmp_path, talker, sentences):
    first, second, rate = sentences
    between = np.concatenate([noise(5, -70, rate), breath(1, rate), noise(0.5, -70, rate), music(3, rate), drums(2, rate)])
    sound = tmp_path / "a.wav"
    save_wav(sound, np.concatenate([first, between, second]).astype(np.float32), rate)
    curves, _ = spoken(talker, sound, tmp_path)
    begin_s, end_s = len(first) / rate, (len(first) + len(between)) / rate
    rest = slice(round((begin_s + REST_S) * FPS), round((end_s - REST_S) * FPS))
    assert curves["jawOpen"][rest].max() < 0.05
    assert min(curves["jawOpen"][: rest.start].max(), curves["jawOpen"][rest.stop :].max()) > 0.5


@pytest.mark.parametrize("kind", [music, tune, drums, breath])
def test_nothing_is_said_to_what_is_no_speech(tmp_path, talker, kind):
    rate = 22050
    sound = tmp_path / "a.wav"
    save_wav(sound, np.concatenate([noise(0.5, -70, rate), kind(3, rate)]).astype(np.float32), rate)
    code, _, said = run("speak", talker, sound, "-o", tmp_path / "a.csv")
    assert (code, "no speech is heard in the sound" in said) == (2, True), said


class Heard:
    """A network that hears stretches of phones, each with its own confidence."""

    def __init__(self, stretches):
        self.stretches = stretches

    def spikes(self, audio, rate):
        return [
            Spike("aa", start_s + 0.1 * k, start_s + 0.1 * k, sure, False)
            for start_s, count, sure in self.stretches
            for k in range(count)
        ]


def test_stretches_that_are_hardly_speech_are_left_out_and_told_with_their_times(monkeypatch):
    sound = noise(12, -20, 16000).astype(np.float32)
    heard = Heard([(0.5, 8, 0.9), (2.5, 6, 0.3), (4.0, 2, 0.35), (6.0, 5, 0.45), (9.0, 2, 0.39), (10.5, 1, 0.8)])
    monkeypatch.setattr("facesynth.speech.recognition.phone_hearing", lambda: heard)
    kept, remarks = speech_in(sound, 16000)
    assert sorted({round(spike.confidence, 2) for spike in kept}) == [0.39, 0.45, 0.8, 0.9]
    assert [remark[:25] for remark in remarks] == [
        "from 2.5 to 3.0 s what is",
        "from 4.0 to 4.1 s what is",
        "from 6.0 to 6.4 s phones ",
    ]
    heard.stretches = [(1.0, 3, 0.3)]
    with pytest.raises(FacesynthError, match="no speech is heard"):
        speech_in(sound, 16000)
