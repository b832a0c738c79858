"""Sounds that are no speech: noise between sentences, breath, music, drums; lips rest, and nothing is said to music."""

import re
from dataclasses import replace

import numpy as np
import pytest
from bringing import FPS, run, spoken
from scipy.signal import butter, sosfilt

from facesynth.inference.errors import FacesynthError
from facesynth.inference.speech import EmotionTrack, PhoneTrack, Speech
from facesynth.inference.speech_or_music import is_speech
from facesynth.inference.spikes import Spike
from facesynth.speech.audio import load_audio, save_wav
from facesynth.speech.phone_graph import phone_hearing
from facesynth.speech.phone_sources import find_phones
from facesynth.speech.recognition import speech_in, speech_or_music
from facesynth.stage.silent_pauses import SilentPauses, long_pauses

REST_S = 0.3
"""After speech lips are at rest within it."""
BREATH_S = 0.7
"""So long before a sentence a talker's lips may part."""


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


def melody(kind, seconds, rate):
    """Single notes, three a second, one after the other with little between them."""
    times_s = np.arange(rate // 3) / rate
    held = np.minimum(1, times_s / 0.01) * np.clip((0.3 - times_s) / 0.02, 0, 1)

    def note(hz):
        phase = 2 * np.pi * hz * times_s
        return (
            held
            * {
                "sine": lambda: np.sin(phase),
                "square": lambda: sum(np.sin(k * phase) / k for k in (1, 3, 5, 7, 9)),
                "vibrato": lambda: sum(np.sin(k * (phase + hz / 300 * np.sin(2 * np.pi * 6 * times_s))) / k for k in range(1, 9)),
                "piano": lambda: sum(
                    np.sin(k * (1 + 2e-4 * k * k) * phase) * np.exp(-(2 + k) * times_s) / k for k in range(1, 11)
                ),
                "organ": lambda: sum(np.sin(k * phase) for k in (0.5, 1, 2, 3, 4)),
            }[kind]()
        )

    steps = (0, 4, 7, 5, 2, 4, 0, 7, 12)
    played = np.concatenate([note(262 * 2 ** (steps[k % len(steps)] / 12)) for k in range(round(3 * seconds))])
    return 0.3 * played / np.abs(played).max()


BETWEEN_S = 3.0


@pytest.mark.parametrize("kind", ["sine", "square", "vibrato", "piano", "organ", "tune"])
def test_a_tune_between_two_sentences_is_not_said_and_told_with_its_times(tmp_path, talker, sentences, kind):
    first, second, rate = sentences
    played = tune(BETWEEN_S, rate) if kind == "tune" else melody(kind, BETWEEN_S, rate)
    begin_s, end_s = len(first) / rate, (len(first) + len(played)) / rate
    sound = tmp_path / "a.wav"
    save_wav(sound, np.concatenate([first, played, second]).astype(np.float32), rate)
    curves, facts = spoken(talker, sound, tmp_path)
    assert curves["jawOpen"][round((begin_s + REST_S) * FPS) : round((end_s - REST_S) * FPS)].max() < 0.05
    (told,) = [remark for remark in facts["remarks"] if "The lips rest there" in remark]
    start_s, stop_s = map(float, re.search(r"from ([\d.]+) to ([\d.]+) s", told).groups())
    assert np.abs(np.subtract((start_s, stop_s), (begin_s, end_s))).max() < 0.4, (told, begin_s, end_s)
    unspoilt = tmp_path / "b.wav"
    save_wav(unspoilt, np.concatenate([first, np.zeros(len(played)), second]).astype(np.float32), rate)
    without, _ = spoken(talker, unspoilt, tmp_path)
    said = slice(0, round((begin_s - 0.1) * FPS))
    assert np.abs(curves["jawOpen"][said] - without["jawOpen"][said]).mean() < 0.1


def test_a_model_that_listens_rests_too(tmp_path, sentences):
    first, second, rate = sentences
    sound = tmp_path / "a.wav"
    save_wav(sound, np.concatenate([first, melody("organ", BETWEEN_S, rate), second]).astype(np.float32), rate)
    curves, _ = spoken("grid-s1-network", sound, tmp_path)
    begin_s, end_s = len(first) / rate, len(first) / rate + BETWEEN_S
    rest = curves["jawOpen"][round((begin_s + REST_S) * FPS) : round((end_s - BREATH_S) * FPS)]
    assert rest.max() < 0.25 * curves["jawOpen"][: round(begin_s * FPS)].max()


def test_a_model_that_is_told_nothing_is_told_where_nobody_speaks(sentences):
    first, second, rate = sentences
    sound = np.concatenate([first, melody("organ", BETWEEN_S, rate), second]).astype(np.float32)
    found = find_phones(sound, rate, sought="heard")
    ((start_s, stop_s),) = [span for span in long_pauses(found.phones) if span[1] - span[0] > 1]
    assert start_s < len(first) / rate + REST_S
    assert stop_s > len(first) / rate + BETWEEN_S - BREATH_S
    assert ["none are needed" in found.remarks[0], *("The lips rest there" in remark for remark in found.remarks[1:])] == [
        True
    ] * 2
    with pytest.raises(FacesynthError, match="no speech is heard"):
        find_phones(melody("organ", BETWEEN_S, rate).astype(np.float32), rate, sought="heard")


@pytest.mark.parametrize("pitch_hz", [0, 130, 220], ids=["whispered", "low", "high"])
def test_speech_on_one_note_and_whispered_speech_are_said(sentences, pitch_hz):
    pyworld = pytest.importorskip("pyworld")
    first, second, rate = sentences
    sound = np.concatenate([first, second]).astype(np.float64)
    pitch, times_s = pyworld.harvest(sound, rate)
    parts = pyworld.cheaptrick(sound, pitch, times_s, rate), pyworld.d4c(sound, pitch, times_s, rate)
    sung = pyworld.synthesize(np.where(pitch > 0, float(pitch_hz), 0.0), *parts, rate).astype(np.float32)
    heard, log_odds = phone_hearing().judged_spikes(sung, rate, speech_or_music())
    kept, remarks = speech_in(sung, rate)
    assert len(kept) == len(heard), log_odds
    assert not any("rest" in remark for remark in remarks)


@pytest.mark.slow
@pytest.mark.parametrize(("folder", "kind"), [("ravdess_speech", "*.flac"), ("grid_s1", "*.mpg"), ("facegood", "*.wav")])
def test_no_phone_of_a_real_talker_is_taken_for_music(recordings, folder, kind):
    taken = {}
    for path in sorted(recordings(folder).rglob(kind)):
        _, log_odds = phone_hearing().judged_spikes(*load_audio(path), speech_or_music())
        if not is_speech(log_odds).all():
            taken[path.name] = int((~is_speech(log_odds)).sum())
    assert not taken


def test_a_change_between_speech_and_music_must_be_worth_it():
    odds = np.array([5, 4, -3, 5, 6, -4, -5, -4, -6, -5, 4, 5, 5, 3], np.float32)
    assert is_speech(odds).tolist() == [True] * 5 + [False] * 5 + [True] * 4
    assert is_speech(np.array([-0.5, -1], np.float32)).tolist() == [False, False]
    assert is_speech(np.zeros(0, np.float32)).tolist() == []


def test_long_pauses_are_silent_for_models_and_short_ones_are_not():
    rate = 16000
    phones = PhoneTrack(("pau", "aa", "pau", "m", "pau"), np.array([0.5, 1.0, 3.0, 3.4, 4.5]))
    speech = Speech(np.ones(round(4.5 * rate), np.float32), rate, phones, EmotionTrack.constant("neutral", 4.5), "")
    pauses = SilentPauses()
    heard = pauses.of(speech).audio
    at = {time_s: float(heard[round(time_s * rate)]) for time_s in (0.1, 0.45, 1.1, 1.2, 2.0, 2.8, 2.9, 3.2, 3.5, 3.6, 4.4)}
    assert at == {0.1: 1, 0.45: 1, 1.1: 1, 1.2: 0, 2.0: 0, 2.8: 0, 2.9: 1, 3.2: 1, 3.5: 1, 3.6: 0, 4.4: 0}
    assert pauses.of(speech).audio is heard
    nobody = replace(speech, phones=PhoneTrack(("pau",), np.array([4.5])))
    assert pauses.of(nobody) is nobody


class Heard:
    """A network that hears stretches of phones, each with its own confidence, and as speech."""

    def __init__(self, stretches):
        self.stretches = stretches

    def judged_spikes(self, audio, rate, judge):
        found = [
            Spike("aa", start_s + 0.1 * k, start_s + 0.1 * k, sure, False)
            for start_s, count, sure in self.stretches
            for k in range(count)
        ]
        return found, np.full(len(found), 5.0, np.float32)


def test_stretches_that_are_hardly_speech_are_left_out_and_told_with_their_times(monkeypatch):
    sound = np.zeros(12 * 16000, np.float32)
    sound[8000:20000] = noise(0.75, -20, 16000)
    heard = Heard([(0.5, 8, 0.9), (2.5, 6, 0.3), (4.0, 2, 0.35), (6.0, 5, 0.45), (9.0, 2, 0.39), (10.5, 1, 0.8)])
    monkeypatch.setattr("facesynth.speech.recognition.phone_hearing", lambda: heard)
    kept, remarks = speech_in(sound, 16000)
    assert sorted({round(spike.confidence, 2) for spike in kept}) == [0.39, 0.45, 0.8, 0.9]
    assert [remark[:18] for remark in remarks] == ["from 2.5 to 4.1 s ", "from 6.0 to 6.4 s "]
    heard.stretches = [(1.0, 3, 0.3)]
    with pytest.raises(FacesynthError, match="no speech is heard"):
        speech_in(sound, 16000)
