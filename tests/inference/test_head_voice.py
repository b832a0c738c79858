"""Pitch, formants, predictors and prosody of sounds whose answers are known."""

import itertools

import numpy as np
import pytest
from scipy.signal import lfilter

from facesynth.inference.head import voice
from facesynth.inference.pitch import PITCH_WINDOW, RATE

RNG = np.random.default_rng(0)
VOWELS = {"a": (730, 1090, 2440, 3400, 4500), "i": (270, 2290, 3010, 3700, 4600), "o": (570, 840, 2410, 3300, 4400)}


def vowel(formants, pitch_hz, seconds=0.4, rate=RATE):
    """Pulses through resonators."""
    sound = np.zeros(int(seconds * rate))
    sound[np.round(np.arange(0, seconds - 1e-3, 1 / pitch_hz) * rate).astype(int)] = 1.0
    for hz in formants:
        radius = np.exp(-np.pi * 60 / rate)
        sound = lfilter([1.0], [1.0, -2 * radius * np.cos(2 * np.pi * hz / rate), radius**2], sound)
    return 0.3 * sound / np.abs(sound).max()


def windows_of(sound, fps=50.0):
    count = int(len(sound) / RATE * fps)
    return voice.pitch_windows(fps).cut(sound.astype(np.float32), 0, 0, count).astype(np.float64)


@pytest.mark.parametrize("formants", VOWELS.values(), ids=VOWELS)
@pytest.mark.parametrize("pitch_hz", [95, 140, 210])
def test_pitch_and_formants_of_vowels(formants, pitch_hz):
    features, last_hz = voice.voice_features(windows_of(vowel(formants, pitch_hz)), np.nan)
    middle = features[5:-5]
    assert abs(np.median(middle[:, 0]) / pitch_hz - 1) < 0.02
    assert last_hz == features[-1, 0]
    found = np.median(middle[:, 1:4], axis=0)
    assert abs(found[0] - formants[0]) < 0.7 * pitch_hz, "no nearer than the harmonics lie"
    np.testing.assert_allclose(found[1:], formants[1:3], rtol=0.06)


def test_predictors_solve_the_normal_equations():
    power = np.square(np.abs(np.fft.rfft(RNG.standard_normal((7, 400)), voice.FFT))) + 0.1
    found = voice.linear_prediction(power)
    bins = round(voice.CEILING_HZ / RATE * voice.FFT)
    for spectrum, a in zip(power, found, strict=True):
        r = np.fft.irfft(spectrum[: bins + 1])[:13]
        r[0] *= 1 + 1e-6
        matrix = r[np.abs(np.subtract.outer(np.arange(12), np.arange(12)))]
        np.testing.assert_allclose(matrix @ a, -r[1:], atol=1e-8 * r[0])


def test_silence_has_features():
    features, last_hz = voice.voice_features(np.zeros((4, PITCH_WINDOW)), 120.0)
    assert features.shape == (4, 31)
    assert np.isfinite(features).all()
    assert last_hz == 120
    assert np.isfinite(voice.prosody_of([np.zeros((4, PITCH_WINDOW))], 60.0)).all()


def test_features_are_the_same_in_pieces():
    windows = windows_of(np.concatenate([vowel(VOWELS["a"], 120), 0.01 * RNG.standard_normal(4000), vowel(VOWELS["i"], 180)]))
    whole, _ = voice.voice_features(windows, 100.0)
    first, pitch_hz = voice.voice_features(windows[:17], 100.0)
    second, _ = voice.voice_features(windows[17:], pitch_hz)
    np.testing.assert_allclose(np.concatenate([first, second]), whole, rtol=1e-9)


def test_a_bridge_passes_what_is_known_and_does_not_overshoot():
    values, known = np.cumsum(RNG.standard_normal(60)), RNG.random(60) < 0.4
    bridge = voice.bridged(np.where(known, values, np.nan), known)
    np.testing.assert_allclose(bridge[known], values[known])
    knots = np.flatnonzero(known)
    for a, b in itertools.pairwise(knots):
        low, high = sorted((values[a], values[b]))
        assert (bridge[a : b + 1] >= low - 1e-9).all()
        assert (bridge[a : b + 1] <= high + 1e-9).all()


def test_prosody_does_not_know_how_loud_or_how_high_a_voice_is():
    glide = np.concatenate([vowel(VOWELS["a"], hz, 0.2) for hz in (100, 110, 125, 115, 105)])
    higher = np.concatenate([vowel(VOWELS["a"], 1.25 * hz, 0.2) for hz in (100, 110, 125, 115, 105)])
    one, louder, up = (voice.prosody_of([windows_of(sound, 60.0)], 60.0) for sound in (glide, 0.1 * glide, higher))
    np.testing.assert_allclose(louder, one, atol=1e-3 * np.abs(one).max())
    assert np.corrcoef(up[5:-5, 0], one[5:-5, 0])[0, 1] > 0.9


def test_rumble_is_not_heard():
    sound = vowel(VOWELS["a"], 120)
    rumble = 0.5 * np.sin(2 * np.pi * 33 * np.arange(len(sound)) / RATE)
    features, _ = voice.voice_features(windows_of(sound + rumble), np.nan)
    assert abs(np.median(features[5:-5, 0]) / 120 - 1) < 0.02
