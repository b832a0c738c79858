"""What is heard with the installed weights; skipped where they are not installed."""

from itertools import pairwise

import numpy as np
import pytest

from facesynth.inference.ear import RATE
from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import SILENCE
from facesynth.speech.alignment import align
from facesynth.speech.audio import load_audio, resample
from facesynth.speech.phone_archive import is_installed
from facesynth.speech.phone_sources import find_phones
from facesynth.speech.textgrid import read_textgrid, write_textgrid

pytestmark = pytest.mark.skipif(not is_installed(), reason="the weights that phones are heard with are not installed")

FOX = "The quick brown fox jumps over the lazy dog."


@pytest.fixture(scope="module")
def recognise():
    from facesynth.speech.recognition import recognise

    return recognise


def distance(a, b):
    """Levenshtein."""
    row = list(range(len(b) + 1))
    for i, x in enumerate(a, start=1):
        before, row = row, [i]
        for j, y in enumerate(b, start=1):
            row.append(min(before[j] + 1, row[-1] + 1, before[j - 1] + (x != y)))
    return row[-1]


def spoken(track):
    return [label for label in track.labels if label != SILENCE]


def test_a_clear_voice_is_heard_with_confidences(say, recognise):
    audio, rate = say(FOX)
    heard, right = recognise(audio, rate), spoken(align(audio, rate, FOX).phones)
    assert heard.duration_s == len(audio) / rate
    assert distance(spoken(heard), right) <= 0.35 * len(right)
    assert heard.confidences.shape == (len(heard),)
    assert all(sure == 1 for label, sure in zip(heard.labels, heard.confidences, strict=True) if label == SILENCE)


def test_hearing_does_not_depend_on_how_loud_the_sound_is(say, recognise):
    audio, rate = say(FOX)
    loud, quiet = (recognise((gain * audio).astype(np.float32), rate, fit=False) for gain in (1.0, 0.02))
    assert loud.labels == quiet.labels


def test_the_fit_moves_times_and_keeps_phones(say, recognise):
    audio, rate = say(FOX)
    fitted, around = recognise(audio, rate), recognise(audio, rate, fit=False)
    assert spoken(fitted) == spoken(around)
    assert fitted.ends_s.tolist() != around.ends_s.tolist()


def test_hearing_repeats_itself(say, recognise):
    audio, rate = say("Hello, Tom.")
    once, twice = recognise(audio, rate), recognise(audio, rate)
    assert once.labels == twice.labels
    assert once.ends_s.tobytes() == twice.ends_s.tobytes()


def test_a_long_sound_is_heard_as_its_parts_are(say, recognise):
    audio, rate = say(FOX)
    alone, many = spoken(recognise(audio, rate, fit=False)), spoken(recognise(np.tile(audio, 9), rate, fit=False))
    assert distance(many, 9 * alone) <= 0.15 * len(many)


def test_silence_is_refused(recognise):
    with pytest.raises(FacesynthError, match="silent"):
        recognise(np.zeros(16000, np.float32), 16000)


def test_without_words_the_network_hears_and_writes_its_confidence(say, tmp_path):
    audio, rate = say("Hello, Tom.")
    found = find_phones(audio, rate)
    assert found.source == "recognition"
    assert "transcript helps" in found.remarks[0]
    write_textgrid(tmp_path / "a.TextGrid", found.phones)
    assert 'name = "confidence"' in (tmp_path / "a.TextGrid").read_text(encoding="utf-8")
    read = read_textgrid(tmp_path / "a.TextGrid")[0]
    assert read.labels == found.phones.labels
    np.testing.assert_allclose(read.confidences, found.phones.confidences, atol=0.005)


def test_streamed_phones_are_those_of_the_whole_however_the_sound_is_cut(say):
    """The whole is heard with the windows of the same look-ahead: a cut changes nothing, not even the last bit."""
    from facesynth.speech.phone_graph import phone_hearing

    audio, rng = resample(*say("Hello, Tom."), RATE), np.random.default_rng(0)

    def streamed(cuts):
        stream = phone_hearing().stream(look_ahead_s=0.1)
        pieces = [stream.push(piece) for piece in np.split(audio, cuts)]
        return [placed for piece in [*pieces, stream.finish()] for placed in piece]

    whole = streamed([])
    assert sum(one.label != SILENCE for one in whole) >= 5
    assert whole[-1].end_s == len(audio) / RATE
    for count in (1, 7, 400):
        assert streamed(np.sort(rng.integers(0, len(audio) + 1, count))) == whole


def test_a_real_talker_closes_lips_where_the_words_say(recordings, recognise):
    folder = recordings("ravdess_speech")
    audio, rate = load_audio(folder / "Actor_01/03-01-01-01-01-01-01.flac")
    heard = recognise(audio, rate)
    right = align(audio, rate, "Kids are talking by the door").phones
    ends = [[end_s for label, end_s in zip(t.labels, t.ends_s, strict=True) if label in ("b", "p", "m")] for t in (heard, right)]
    assert len(ends[0]) == len(ends[1]) == 1
    assert abs(ends[0][0] - ends[1][0]) < 0.06
    assert all(before < after for before, after in pairwise(heard.ends_s))
