"""Features heard in pieces: what the windows of the whole give, whoever cuts the sound how; made-up bands and network."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facesynth.inference.ear import PEAK, RATE, SHORTEST, SMALLEST_PEAK, STEP
from facesynth.inference.heard import HALF_WINDOW, HOP, Listening, hidden_layer

BLOCK, PAST = 10, 200
"""Frames of a stream's window: those that come out, and those before."""


def bands(sound):
    """[1 + S // HOP, 2] loudest sample and sum around each frame, within HALF_WINDOW."""
    padded = np.pad(sound, (HALF_WINDOW, HALF_WINDOW + HOP))
    around = [padded[k * HOP : k * HOP + 2 * HALF_WINDOW] for k in range(1 + len(sound) // HOP)]
    return np.array([[np.abs(one).max(), one.sum(dtype=np.float64)] for one in around], np.float32)


def network(*, audio):
    """Three numbers for each frame that tell how long the window is and how loud, and the sound at the frame."""
    count = audio.shape[1] // STEP + 1
    at = np.minimum(np.arange(count) * STEP, audio.shape[1] - 1)
    own = np.stack([audio[0, at], np.full(count, count), np.full(count, np.abs(audio).max())], axis=1)
    return [np.zeros((1, count, 1), np.float32), np.stack([0 * own, own], axis=1)[None].astype(np.float32)]


def sound(length, seed):
    rng = np.random.default_rng(seed)
    return (rng.uniform(-0.3, 0.3, length) * np.linspace(0.1, 1, length)).astype(np.float32)


def window_by_window(audio, ahead_s):
    """[1 + S // HOP, 3] the network's layer 1, each window cut from the whole sound, raised by the loudest sample so far."""
    ahead, padded = round(ahead_s * RATE / STEP), np.pad(audio, (0, max(0, SHORTEST - len(audio))))
    count, frames, peak = len(padded) // STEP + 1, [], 0.0
    for first in range(0, count, BLOCK):
        window = padded[max(0, first - PAST) * STEP : (first + BLOCK + ahead) * STEP]
        peak = max(peak, np.abs(window).max())
        heard = network(audio=(window * np.float32(PEAK / max(peak, SMALLEST_PEAK)))[None])[1][0, :, 1]
        frames += list(heard[first - max(0, first - PAST) :][: min(BLOCK, count - first)])
    frames = np.array(frames)
    places = np.minimum(np.arange(1 + len(audio) // HOP) / 2, count - 1)
    return np.stack([np.interp(places, np.arange(count), column) for column in frames.T], axis=1)


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 60000), st.lists(st.integers(0, 9000), max_size=12), st.sampled_from([0.0, 0.1, 0.4]), st.integers(0, 9))
def test_pieces_of_any_size_give_what_the_windows_of_the_whole_give(length, sizes, ahead_s, seed):
    audio, pieces = sound(length, seed), Listening(bands, network, 1).pieces(ahead_s)
    given_ = [pieces.push(piece) for piece in np.split(audio, np.minimum(np.cumsum(sizes), length).astype(int))]
    given_.append(pieces.push(np.zeros(0, np.float32), ended=True))
    got = np.concatenate([rows for rows in given_ if len(rows)])
    wanted = np.hstack([bands(audio), window_by_window(audio, ahead_s)])
    np.testing.assert_allclose(got, wanted, rtol=1e-5, atol=1e-4)


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 60000), st.sampled_from([0.0, 0.1, 0.4]))
def test_a_frame_is_final_no_later_than_is_stated(length, ahead_s):
    for listening in (Listening(bands), Listening(None, network, 1), Listening(bands, network, 1)):
        known = len(listening.pieces(ahead_s).push(sound(length, 0)))
        assert known > (length / RATE - listening.look_ahead_s(ahead_s)) * RATE / HOP - 1


@pytest.mark.parametrize("length", [1, 159, 700, 16000, 250000])
def test_a_layer_of_a_whole_sound_has_a_frame_every_ten_milliseconds(length):
    heard = hidden_layer(network, sound(length, 1), 1)
    assert heard.shape == (1 + length // HOP, 3)
    between = (len(heard) - 1) // 2
    halfway = (heard[: 2 * between : 2] + heard[2 : 2 * between + 1 : 2]) / 2
    np.testing.assert_allclose(heard[1 : 2 * between : 2], halfway, rtol=1e-5)
