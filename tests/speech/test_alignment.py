from itertools import pairwise

import numpy as np
import pytest

from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import SILENCE
from facesynth.speech.alignment import align
from facesynth.speech.audio import load_audio, loudest_db
from facesynth.speech.decoder_recognition import recognise_by_decoder
from facesynth.speech.pieces import quiet_pieces
from facesynth.speech.pronunciation import pronunciations
from facesynth.speech.transcript import words_of

FOX = "The quick brown fox jumps over the lazy dog."


def phones_of(placed):
    return [label for label in placed.phones.labels if label != SILENCE]


def test_phones_are_those_of_the_words_and_cover_the_sound(say):
    audio, rate = say(FOX)
    placed = align(audio, rate, FOX)
    assert placed.phones.duration_s == len(audio) / rate
    assert [word for word, _, _ in placed.words] == list(words_of(FOX))
    left = phones_of(placed)
    for word, _, _ in placed.words:
        said = next(p for p in pronunciations(word) if tuple(left[: len(p)]) == p)
        left = left[len(said) :]
    assert not left
    assert placed.warnings == ()


def test_speech_lies_where_the_sound_is(say):
    audio, rate = say(FOX)
    placed = align(audio, rate, FOX)
    assert placed.phones.labels[0] == placed.phones.labels[-1] == SILENCE
    for start_s, end_s in ((0.0, placed.phones.ends_s[0]), (placed.phones.starts_s[-1], placed.phones.duration_s)):
        inner = audio[round((start_s + 0.06) * rate) : round((end_s - 0.06) * rate)]
        assert loudest_db(inner, rate) < loudest_db(audio, rate) - 20


def test_alignment_follows_the_sound_through_time_rate_and_level(say):
    audio, rate = say(FOX)
    placed = align(audio, rate, FOX)
    moved = align(np.concatenate([np.zeros(rate // 2, np.float32), audio * 0.1]), rate, FOX)
    assert phones_of(moved) == phones_of(placed)
    difference = np.array([b[1] - a[1] for a, b in zip(placed.words, moved.words, strict=True)])
    assert np.median(np.abs(difference - 0.5)) < 0.012
    assert np.abs(difference - 0.5).max() < 0.05


def test_the_same_sound_gives_the_same_times(say):
    audio, rate = say(FOX)
    once, twice = align(audio, rate, FOX), align(audio, rate, FOX)
    assert once.phones.labels == twice.phones.labels
    assert once.phones.ends_s.tobytes() == twice.phones.ends_s.tobytes()


def test_unknown_words_are_sounded_out_with_a_warning(say):
    text = "A wuggish blicket zorched my favourite facesynth."
    placed = align(*say(text), text)
    assert [word for word, _, _ in placed.words] == ["a", "wuggish", "blicket", "zorched", "my", "favourite", "facesynth"]
    assert any("'blicket'" in warning and "b l ih k" in warning for warning in placed.warnings)


@pytest.mark.parametrize(
    "text", ["Please call Stella and ask her to bring these things with her.", "Hello.", "你好", "", FOX * 20]
)
def test_another_transcript_is_refused(say, text):
    audio, rate = say("My favourite colour is green, and we will meet again tomorrow evening.")
    with pytest.raises(FacesynthError, match=r"does not match the sound|holds no English word"):
        align(audio, rate, text)


def test_silence_short_sounds_and_noise_are_refused():
    with pytest.raises(FacesynthError, match="silent"):
        align(np.zeros(16000, np.float32), 16000, "hello")
    with pytest.raises(FacesynthError, match="10 ms"):
        align(np.ones(160, np.float32), 16000, "hello")
    noise = np.random.default_rng(0).normal(0, 0.1, 48000).astype(np.float32)
    with pytest.raises(FacesynthError, match="does not match"):
        align(noise, 16000, "hello my name is stella and i come from london")


def test_long_sounds_are_taken_in_pieces(say):
    audio, rate = say(FOX)
    times = 9
    placed = align(np.tile(audio, times), rate, " ".join([FOX] * times))
    assert placed.phones.duration_s == pytest.approx(times * len(audio) / rate)
    alone = np.array([start_s for _, start_s, _ in align(audio, rate, FOX).words])
    got = np.array([start_s for _, start_s, _ in placed.words]).reshape(times, -1)
    wanted = alone + np.arange(times)[:, None] * len(audio) / rate
    assert np.percentile(np.abs(got - wanted), 95) < 0.05


def test_recognition_hears_most_of_a_clear_voice(say):
    audio, rate = say(FOX)
    heard = recognise_by_decoder(audio, rate)
    assert heard.duration_s == len(audio) / rate
    shared = sum(min(heard.labels.count(phone), phones_of(align(audio, rate, FOX)).count(phone)) for phone in set(heard.labels))
    assert shared >= 18


def test_recognition_repeats_itself(say):
    audio, rate = say("Hello, Tom.")
    once, twice = recognise_by_decoder(audio, rate), recognise_by_decoder(audio, rate)
    assert once.labels == twice.labels
    assert once.ends_s.tobytes() == twice.ends_s.tobytes()


def test_long_sounds_are_recognised_in_pieces(say):
    audio, rate = say("Hello, Tom.")
    pieces = quiet_pieces(np.tile(audio, 60), rate)
    assert pieces[0][0] == 0
    assert pieces[-1][1] == 60 * len(audio)
    assert all(before[1] == after[0] for before, after in pairwise(pieces))
    assert max(stop - start for start, stop in pieces) <= 17 * rate
    cuts = [np.tile(audio, 60)[stop - rate // 30 : stop + rate // 30] for _, stop in pieces[:-1]]
    assert max(loudest_db(cut, rate) for cut in cuts) < loudest_db(audio, rate) - 30


def test_recognition_refuses_silence():
    with pytest.raises(FacesynthError, match="silent"):
        recognise_by_decoder(np.zeros(16000, np.float32), 16000)


def test_a_real_talker(recordings):
    folder = recordings("grid_s1")
    for clip in sorted(folder.glob("*.mpg"))[:3]:
        said = [line.split() for line in clip.with_suffix(".align").read_text().splitlines()]
        said = [(word, int(start) / 25000) for start, _, word in said if word != "sil"]
        placed = align(*load_audio(clip), " ".join(word for word, _ in said))
        late_s = np.array([got[1] - start for got, (_, start) in zip(placed.words, said, strict=True)])
        assert np.median(np.abs(late_s)) < 0.03
        with pytest.raises(FacesynthError, match="does not match"):
            align(*load_audio(clip), "kids are talking by the door")


@pytest.mark.parametrize("clip", ["Actor_01/03-01-01-01-01-01-01.flac", "Actor_04/03-01-05-02-01-02-04.flac"])
def test_calm_and_shouted_speech(recordings, clip):
    audio, rate = load_audio(recordings("ravdess_speech") / clip)
    placed = align(audio, rate, "Kids are talking by the door")
    assert 0.7 < placed.words[0][1] < 1.3
    with pytest.raises(FacesynthError, match="does not match"):
        align(audio, rate, "she had your dark suit in greasy wash water all year")
