"""Cut-off frequencies that the data name (Cao 2005, §4.3, smoothing)."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

ENERGY_SHARE = 0.99
"""Share of a component's energy that lies below its cut-off frequency."""
SEGMENT_S = 1.0
"""Length of the stretches whose spectra are averaged; half of it overlaps."""


def energy_spectrum(pieces: Iterable[NDArray[np.float64]], fps: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Frequencies [F] (Hz) and the mean energy of each component there [F, D].

    pieces: motions [T, D]. Each is cut into Hann-windowed stretches of a second, its own mean removed first;
    the window keeps the ends of a stretch from looking like fast motion.
    """
    length = max(4, round(SEGMENT_S * fps))
    window = np.hanning(length + 2)[1:-1, None]
    energy: NDArray[np.float64] | float = 0.0
    for piece in pieces:
        padded = np.concatenate([piece - piece.mean(axis=0), np.zeros((max(0, length - len(piece)), piece.shape[1]))])
        for start in range(0, len(padded) - length + 1, length // 2):
            energy = energy + np.square(np.abs(np.fft.rfft(padded[start : start + length] * window, axis=0)))
    return np.asarray(np.fft.rfftfreq(length, 1 / fps), np.float64), np.asarray(energy, np.float64)


def cutoffs_hz(pieces: Iterable[NDArray[np.float64]], fps: float) -> NDArray[np.float64]:
    """[D] the frequency below which 99 % of each component's energy lies in these motions [T, D]."""
    frequencies, energy = energy_spectrum(pieces, fps)
    share = np.cumsum(energy, axis=0) / np.maximum(energy.sum(axis=0), np.finfo(float).tiny)
    return frequencies[np.minimum((share < ENERGY_SHARE).sum(axis=0) + 1, len(frequencies) - 1)]
