"""Windows, spikes and streams, with a made-up network: the installed weights are tried in tests/speech."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facesynth.inference.ear import PEAK, RATE, STEP, Ear, Reach
from facesynth.inference.errors import FacesynthError
from facesynth.inference.phone_hearing import PhoneHearing
from facesynth.inference.spikes import LAG_S, REACH_S, Alphabet, placed_around, spikes

TOKENS = ("p", "a", "ai", "<wb>", "<blank>")
ALPHABET = Alphabet(TOKENS, (("p",), ("aa",), ("aa", "iy"), (), ()))
BLANK, WIDTH = 4, 3


def network(*, audio):
    """A frame's token by the loudness of its window, and by how long the window is: whoever cuts otherwise hears otherwise."""
    count = audio.shape[1] // STEP + 1
    padded = np.pad(audio[0], (STEP // 2, STEP))
    levels = np.array([np.abs(padded[t * STEP : (t + 1) * STEP]).max() for t in range(count)])
    scores = np.stack([np.cos(k + 40 * levels + count) for k in range(len(TOKENS))], axis=1)
    log_probabilities = scores - np.log(np.exp(scores).sum(axis=1, keepdims=True))
    return [log_probabilities[None].astype(np.float32), np.repeat(levels[None, :, None, None], WIDTH, axis=3)]


def sound(length, seed=0):
    return np.random.default_rng(seed).uniform(-0.3, 0.3, length).astype(np.float32)


@settings(max_examples=60, deadline=None)
@given(
    st.integers(1, 40000),
    st.lists(st.integers(1, 9000), max_size=12),
    st.sampled_from([0.0, 0.1, 0.4, 0.8]),
    st.integers(0, 9),
)
def test_a_stream_hears_the_same_however_the_sound_is_cut(length, sizes, look_ahead_s, seed):
    audio, model = sound(length, seed), PhoneHearing(network, ALPHABET)
    whole = model.stream(look_ahead_s=look_ahead_s)
    wanted = [*whole.push(audio), *whole.finish()]
    stream, got, at = model.stream(look_ahead_s=look_ahead_s), [], 0
    for size in sizes:
        got += stream.push(audio[at : at + size])
        at += size
    got += [*stream.push(audio[at:]), *stream.finish()]
    assert got == wanted
    ends_s = [one.end_s for one in got]
    assert all(before < after for before, after in zip([0.0, *ends_s], ends_s, strict=False))
    assert ends_s[-1] == pytest.approx(length / RATE)


@given(st.integers(1, 60000), st.sampled_from([0.1, 0.4]))
@settings(max_examples=20, deadline=None)
def test_a_frame_waits_no_longer_than_is_stated(length, ahead_s):
    ear = Ear(network, Reach.seconds(0.2, 1.0, ahead_s))
    _, state = ear.advance(ear.start(), sound(length))
    assert state.frames * STEP > length - round(ear.reach.look_ahead_s * RATE) - STEP


def test_every_frame_of_a_whole_sound_is_heard_once():
    for length in (800, 16000, 16000 * 25 + 77):
        log_probabilities, hidden = Ear(network).hear(sound(length))
        assert len(log_probabilities) == len(hidden) == length // STEP + 1


def test_the_network_gets_sound_of_one_peak():
    seen = []

    def listening(*, audio):
        seen.append(np.abs(audio).max())
        return network(audio=audio)

    quiet = 0.01 * sound(RATE)
    Ear(listening).hear(quiet)
    assert seen == [pytest.approx(PEAK)]


def test_frames_of_a_window_are_those_of_the_whole():
    """A network that looks at no neighbours gives the same in windows as at once."""

    def plain(*, audio):
        count = audio.shape[1] // STEP + 1
        padded = np.pad(audio[0], (0, STEP))
        rows = np.stack([padded[t * STEP : t * STEP + len(TOKENS)] for t in range(count)])
        return [rows[None], rows[None, :, None]]

    audio = sound(16000 * 25)
    got, _ = Ear(plain).hear(audio)
    np.testing.assert_allclose(got, plain(audio=audio[None] * (PEAK / np.abs(audio).max()))[0][0], rtol=1e-5)


@pytest.mark.parametrize("lengths", [(0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, -0.1)])
def test_impossible_windows_are_refused(lengths):
    with pytest.raises(FacesynthError, match="look-ahead"):
        Reach.seconds(*lengths)


def rows(*tokens):
    """Log-probabilities in which each frame is sure of its token by nine to one."""
    probabilities = np.full((len(tokens), len(TOKENS)), 0.1 / (len(TOKENS) - 1))
    probabilities[np.arange(len(tokens)), [TOKENS.index(token) for token in tokens]] = 0.9
    return np.log(probabilities).astype(np.float32)


def test_spikes_of_a_known_line():
    found = spikes(rows("<blank>", "p", "p", "<blank>", "p", "<wb>", "ai"), ALPHABET)
    assert [spike.phone for spike in found] == ["p", "p", "aa", "iy"]
    assert [spike.begins_word for spike in found] == [True, False, True, False]
    assert found[0].first_s == pytest.approx(0.02 - LAG_S)
    assert found[0].last_s == pytest.approx(0.04 - LAG_S)
    assert all(0.9 <= spike.confidence < 1 for spike in found)


def test_phones_meet_half_way_and_silence_fills_the_rest():
    found = spikes(rows(*["<blank>"] * 20, "p", *["<blank>"] * 3, "a", *["<blank>"] * 20), ALPHABET)
    placed = placed_around(found, 0.9)
    assert [one.label for one in placed] == ["pau", "p", "aa", "pau"]
    ends_s = [0.4 - LAG_S - REACH_S, 0.44 - LAG_S, 0.48 - LAG_S + REACH_S, 0.9]
    assert [one.end_s for one in placed] == pytest.approx(ends_s)


def test_tokens_without_a_blank_are_refused():
    with pytest.raises(FacesynthError, match="<blank>"):
        Alphabet(("p", "<wb>"), (("p",), ()))
    with pytest.raises(FacesynthError, match="2 of the 3|of 3"):
        Alphabet(("p", "<wb>", "<blank>"), (("p",), ()))
