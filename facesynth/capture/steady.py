"""Taking the trembling out of tracked points without delay and without opening shut lips.

A zero-phase low-pass (Butterworth, run forwards and backwards). Its cut-off is measured, not guessed: see `CUTOFF_HZ`.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from facesynth.motion.gaps import missing_in, runs

CUTOFF_HZ = 8.0
HIGHEST_SHARE = 0.9
"""A cut-off above this share of the Nyquist frequency would take nothing out, so nothing is done."""


def steadied(signal: NDArray[np.floating], fps: float, cutoff_hz: float = CUTOFF_HZ) -> NDArray[np.float64]:
    """A signal [T, …] with movement quicker than the cut-off taken out; frames with NaN stay, and part it."""
    values = np.array(signal, np.float64)
    if cutoff_hz >= HIGHEST_SHARE * fps / 2 or not len(values):
        return values
    lowpass = butter(2, 2 * cutoff_hz / fps, output="sos")
    for run in runs(~missing_in(values.reshape(len(values), -1))):
        piece = values[run.start : run.stop]
        if len(piece) > 1:
            values[run.start : run.stop] = sosfiltfilt(lowpass, piece, axis=0, padlen=min(len(piece) - 1, 9))
    return values
