"""Pitch of windows of sound."""

import numpy as np

from .arrays import Floats

RATE = 16000
"""Hz of the sound."""
PITCH_WINDOW, PITCH_FFT = 800, 2048
LOWEST_HZ, HIGHEST_HZ = 65, 500
OCTAVE_COST = 0.02
"""What an octave down costs a pitch candidate, in units of the autocorrelation: the highest good one wins."""
TOGETHER = 128
"""Windows whose spectra are there at once: of 2,048 they are 100 MB."""
VOICED = 0.55
"""Autocorrelation from which a frame counts as voiced."""


def pitch_of(framed: Floats) -> tuple[Floats, Floats]:
    """Octaves above 100 Hz and periodicity [T] of windows [T, PITCH_WINDOW].

    By the autocorrelation divided by the window's own (Boersma 1993).
    """
    window = np.hanning(PITCH_WINDOW)
    own = _autocorrelation(window[None])[0]
    pieces = [_pitch_of_some(framed[k : k + TOGETHER], window, own) for k in range(0, max(1, len(framed)), TOGETHER)]
    octaves, periodicity = (np.concatenate(column) for column in zip(*pieces, strict=True))
    return octaves, periodicity


def _pitch_of_some(framed: Floats, window: Floats, own: Floats) -> tuple[Floats, Floats]:
    found = _autocorrelation((framed - framed.mean(axis=1, keepdims=True)) * window)
    found = found / np.maximum(found[:, :1], 1e-9) / (own / own[0])
    shortest, longest = RATE // HIGHEST_HZ, RATE // LOWEST_HZ
    lags = np.arange(shortest, longest)
    best = (found[:, lags] - OCTAVE_COST * np.log2(lags / shortest)).argmax(axis=1)
    return np.log2(RATE / lags[best] / 100), found[np.arange(len(found)), lags[best]]


def _autocorrelation(windowed: Floats) -> Floats:
    return np.fft.irfft(np.square(np.abs(np.fft.rfft(windowed, PITCH_FFT))))[:, :PITCH_WINDOW]
