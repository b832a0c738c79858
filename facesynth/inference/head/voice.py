"""What of a voice the head follows: pitch, formants, cepstra and predictors, or prosody alone (Deng 2006, §4.3, §4.4)."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..pitch import HIGHEST_HZ, PITCH_WINDOW, RATE, VOICED, pitch_of
from ..windows import FrameWindows

WINDOW_S = 0.030
"""Of the 31 features."""
FFT = 512
FORMANTS, CEPSTRA, PREDICTORS = 5, 13, 12
FEATURES = 1 + FORMANTS + CEPSTRA + PREDICTORS
BANDS = 26
PREEMPHASIS = 0.97
CEILING_HZ = 5500.0
"""Formants and predictors describe the spectrum below this."""
NEUTRAL_HZ = 550.0 * (2 * np.arange(FORMANTS) + 1)
"""Resonances of a uniform tube of 16 cm, where a window shows fewer."""
WIDEST_HZ = 700.0
"""A resonance that is wider is none."""
SMALLEST_POWER = 1e-7
RUMBLE_HZ = 80.0
PROSODY_WINDOW_S = 0.025
PROSODY = 6
QUIET_DB = -60.0
"""Energy counts from here, relative to the loudest tenth."""
SLIP_OCTAVES = 0.8
"""A pitch that is further from the median is taken for an octave slip and bridged."""
FAINT_DB = -30.0
"""What is fainter has no pitch: it may be the hum of a room."""


def pitch_windows(fps: float) -> FrameWindows:
    """Windows of sound, each centred on the time of its frame."""
    return FrameWindows(fps, RATE, PITCH_WINDOW, -0.5 / fps)


def voice_features(windows: Floats, pitch_before_hz: float) -> tuple[Floats, float]:
    """[T, 31] F0 (Hz), F1 to F5 (Hz), 13 cepstra, 12 predictors of windows [T, PITCH_WINDOW] of sound at RATE.

    Between voiced windows the last pitch is held, so that no sound is waited for; `pitch_before_hz` is the one before the
    first, and the last one comes beside the features.
    """
    windows = without_rumble(windows)
    octaves, voiced = _heard_pitch(windows)
    pitch_hz = _held(100 * 2.0**octaves, voiced, pitch_before_hz)
    power = _power(windows)
    predictors = linear_prediction(power)
    features = np.concatenate([pitch_hz[:, None], formants_of(predictors), _cepstra(power), predictors], axis=1)
    return features, float(pitch_hz[-1]) if len(pitch_hz) else pitch_before_hz


def prosody_of(pieces: Iterable[Floats], fps: float) -> Floats:
    """[T, 6] pitch and energy with first and second differences, of windows [T, PITCH_WINDOW] of a whole utterance, in pieces.

    Pitch is a logarithm, bridged by cubics where nothing is voiced, and counts from the speaker's own median; energy is the
    RMS of 25 ms in dB below the loudest tenth. Both in their own standard deviations: no model knows the speaker's level.
    """
    octaves, voiced, rms = (np.concatenate(part) for part in zip(*map(_pitch_and_rms, pieces), strict=True))
    energy = 20 * np.log10(np.maximum(rms / max(np.percentile(rms, 90), 1e-9), 10 ** (QUIET_DB / 20)))
    voiced &= energy > FAINT_DB
    voiced &= np.abs(octaves - np.median(octaves[voiced] if voiced.any() else octaves)) < SLIP_OCTAVES
    pitch = bridged(octaves, voiced) if voiced.any() else np.zeros(len(octaves))
    tracks = np.stack([_own_scale(pitch), _own_scale(energy)], axis=1)
    slopes = np.gradient(tracks, axis=0) * fps if len(tracks) > 1 else np.zeros_like(tracks)
    bends = np.gradient(slopes, axis=0) * fps if len(tracks) > 1 else np.zeros_like(tracks)
    return np.concatenate([tracks, slopes, bends], axis=1)


def _pitch_and_rms(windows: Floats) -> tuple[Floats, NDArray[np.bool_], Floats]:
    windows = without_rumble(windows)
    length = round(PROSODY_WINDOW_S * RATE)
    middle = (PITCH_WINDOW - length) // 2
    return *_heard_pitch(windows), np.sqrt(np.square(windows[:, middle : middle + length]).mean(axis=1))


def without_rumble(windows: Floats) -> Floats:
    """Windows [T, PITCH_WINDOW] without what lies under RUMBLE_HZ: rooms and cameras are as loud there as a voice."""
    turns = np.arange(int(RUMBLE_HZ * PITCH_WINDOW / RATE) + 1)
    angle = 2 * np.pi * np.outer(np.arange(PITCH_WINDOW) / PITCH_WINDOW, turns)
    slow, _ = np.linalg.qr(np.concatenate([np.cos(angle), np.sin(angle[:, 1:])], axis=1))
    return windows - (windows @ slow) @ slow.T


def _heard_pitch(windows: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Octaves above 100 Hz, and which windows are voiced: a peak at the end of the range is the slope of a noise."""
    octaves, periodicity = pitch_of(windows)
    return octaves, (periodicity > VOICED) & (100 * 2.0**octaves < 0.99 * HIGHEST_HZ)


# Selective linear prediction (Makhoul 1975): the autocorrelation is that of the spectrum below a ceiling alone, as if the sound
# had been resampled to twice the ceiling. r = irfft(power below the ceiling); Levinson-Durbin solves sum_k a_k r_|i-k| = -r_i.
def linear_prediction(power: Floats) -> Floats:
    """[T, 12] predictors a_1 to a_12 of 1 + sum_k a_k z^-k from power spectra [T, FFT / 2 + 1]."""
    bins = round(CEILING_HZ / RATE * FFT)
    r = np.fft.irfft(power[:, : bins + 1], axis=1)[:, : PREDICTORS + 1]
    r[:, 0] *= 1 + 1e-6
    a = np.zeros_like(r)
    a[:, 0], error = 1.0, r[:, 0].copy()
    for k in range(1, PREDICTORS + 1):
        reflection = -(a[:, :k] * r[:, k:0:-1]).sum(axis=1) / error
        a[:, 1 : k + 1] += reflection[:, None] * a[:, k - 1 :: -1][:, :k]
        error *= 1 - reflection**2
    return a[:, 1:]


def formants_of(predictors: Floats) -> Floats:
    """[T, 5] frequencies (Hz) of the lowest narrow resonances of predictors [T, 12], rising; NEUTRAL_HZ where there are fewer."""
    companion = np.zeros((len(predictors), PREDICTORS, PREDICTORS))
    companion[:, 0] = -predictors
    companion[:, np.arange(1, PREDICTORS), np.arange(PREDICTORS - 1)] = 1.0
    poles = np.linalg.eigvals(companion)
    hz = np.angle(poles) * CEILING_HZ / np.pi
    width_hz = -2 * np.log(np.maximum(np.abs(poles), 1e-9)) * CEILING_HZ / np.pi
    narrow = (hz > 90) & (hz < CEILING_HZ - 90) & (width_hz < WIDEST_HZ)
    found = np.sort(np.where(narrow, hz, np.inf), axis=1)[:, :FORMANTS]
    return np.asarray(np.where(np.isfinite(found), found, NEUTRAL_HZ))


def bridged(values: Floats, known: NDArray[np.bool_]) -> Floats:
    """[T] values where they are known; between them monotone cubics (Fritsch & Carlson 1980), before and after them held."""
    knots = np.flatnonzero(known)
    if len(knots) < 3:
        return np.interp(np.arange(len(values)), knots, values[knots])
    y, widths = values[knots], np.diff(knots).astype(np.float64)
    secants = np.diff(y) / widths
    same_way = secants[1:] * secants[:-1] > 0
    harmonic = 2 / (1 / np.where(same_way, secants[1:], 1.0) + 1 / np.where(same_way, secants[:-1], 1.0))
    slopes = np.concatenate([secants[:1], np.where(same_way, harmonic, 0.0), secants[-1:]])
    at = np.clip(np.arange(len(values), dtype=np.float64), knots[0], knots[-1])
    low = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(knots) - 2)
    u, h = (at - knots[low]) / widths[low], widths[low]
    start, stop = (1 + 2 * u) * (1 - u) ** 2 * y[low], u**2 * (3 - 2 * u) * y[low + 1]
    return np.asarray(start + stop + h * (u * (1 - u) ** 2 * slopes[low] - u**2 * (1 - u) * slopes[low + 1]))


def _held(values: Floats, known: NDArray[np.bool_], before: float) -> Floats:
    """[T] the last known value at each frame."""
    last = np.maximum.accumulate(np.where(known, np.arange(len(values)), -1))
    return np.where(last >= 0, values[np.maximum(last, 0)], before)


def _power(windows: Floats) -> Floats:
    """[T, FFT / 2 + 1] power spectra of the middle 30 ms, high frequencies raised."""
    length = round(WINDOW_S * RATE)
    middle = (PITCH_WINDOW - length) // 2
    spectrum = np.fft.rfft(windows[:, middle : middle + length] * np.hamming(length), FFT, axis=1)
    raised = 1 + PREEMPHASIS**2 - 2 * PREEMPHASIS * np.cos(2 * np.pi * np.arange(FFT // 2 + 1) / FFT)
    return np.square(np.abs(spectrum)) * raised + SMALLEST_POWER


def _cepstra(power: Floats) -> Floats:
    """[T, 13] orthonormal cosine transform of the logarithm of the power in mel bands."""
    n, k = np.arange(BANDS), np.arange(CEPSTRA)
    cosines = np.sqrt(2 / BANDS) * np.cos(np.pi * np.outer(n + 0.5, k) / BANDS)
    cosines[:, 0] /= np.sqrt(2)
    return np.log(power @ mel_bands()) @ cosines


def mel_bands() -> Floats:
    """[FFT / 2 + 1, BANDS] triangles that rise and fall between points at even distances in mel, 0 to RATE / 2."""
    top = 2595 * np.log10(1 + RATE / 2 / 700)
    edges = 700 * (10 ** (np.linspace(0, top, BANDS + 2) / 2595) - 1)
    hz = np.arange(FFT // 2 + 1)[:, None] * RATE / FFT
    rise = (hz - edges[:-2]) / np.diff(edges)[:-1]
    fall = (edges[2:] - hz) / np.diff(edges)[1:]
    return np.asarray(np.maximum(0, np.minimum(rise, fall)))


def _own_scale(track: Floats) -> Floats:
    """About its median, in its own standard deviations; zeros where it does not move."""
    spread = track.std()
    return (track - np.median(track)) / spread if spread > 1e-6 else np.zeros_like(track)
