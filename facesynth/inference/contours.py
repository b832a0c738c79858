"""What a voice does over time: timbre, loudness, pitch and colour, a hundred times a second."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arrays import Floats
from .errors import FacesynthError
from .pitch import PITCH_WINDOW, RATE, VOICED, pitch_of

HOP = 160
WINDOW, FFT = 400, 512
QUIETER_DB = 35.0
"""Frames this far under the loudest one are silence where an utterance begins and ends."""
LEAST_FRAMES = 10
SMALLEST_POWER = 1e-8
STILL = 1e-4
"""A sound that moves less than this is constant."""

FrontEnd = Callable[..., list[NDArray[Any]]]
"""`audio` [1, S] at 16 kHz to power [1, T, 257], log mel bands [1, T, 40] and cepstra [1, T, 20], frames 10 ms apart."""
_FREQUENCIES = np.arange(FFT // 2 + 1) * RATE / FFT


@dataclass(frozen=True, eq=False)
class Contours:
    """T frames at 100 Hz, silence at both ends left out."""

    bands: Floats
    """[T, 40] logarithm of the power in mel bands."""
    cepstra: Floats
    """[T, 20] mel-frequency cepstra."""
    level: Floats
    """[T] level relative to the loudest frame, in 10 dB."""
    pitch: Floats
    """[T] octaves above 100 Hz, meaningful where voiced."""
    periodicity: Floats
    """[T] autocorrelation at the pitch period, about 0 (noise) to 1."""
    voiced: NDArray[np.bool_]
    """[T] true for at least five frames."""
    colour: Floats
    """[T, 8] centroid, slopes and roll-off of the spectrum, its flux and zero crossings."""
    begin_s: float
    """Where in the sound the first frame lies, seconds."""


def contours(audio: NDArray[np.float32], front: FrontEnd) -> Contours:
    """Contours of audio [S] at 16 kHz; FacesynthError where it is constant or too short."""
    require_voice(audio)
    power, bands, cepstra = (found[0] for found in front(audio=audio[None]))
    level = np.log10(power.sum(axis=1) + 10 * SMALLEST_POWER)
    loud = np.flatnonzero(level > level.max() - QUIETER_DB / 10)
    kept = slice(int(loud[0]), max(loud[-1] + 1, loud[0] + LEAST_FRAMES))
    sound = audio.astype(np.float64)
    pitch, periodicity = pitch_of(_frames(sound, PITCH_WINDOW)[kept])
    voiced = periodicity > VOICED
    if voiced.sum() < 5:
        voiced = periodicity >= np.sort(periodicity)[-5]
    return Contours(
        bands[kept],
        cepstra[kept],
        level[kept] - level.max(),
        _one_octave(pitch, voiced),
        periodicity,
        voiced,
        _colour(_frames(sound, WINDOW)[kept], power[kept], bands[kept]),
        kept.start * HOP / RATE,
    )


def require_voice(audio: NDArray[np.float32]) -> None:
    """FacesynthError where sound [S] at 16 kHz is constant or too short."""
    if len(audio) >= LEAST_FRAMES * HOP and float(np.ptp(audio)) >= STILL:
        return
    what = "constant (silence?)" if len(audio) >= LEAST_FRAMES * HOP else f"only {len(audio) / RATE * 1000:.0f} ms long"
    raise FacesynthError(f"the sound is {what}; to detect an emotion, somebody must speak for at least {LEAST_FRAMES * 10} ms")


def _frames(audio: Floats, length: int) -> Floats:
    """[1 + S // HOP, length] frames centred on multiples of the hop."""
    padded = np.pad(audio, (length // 2, length))
    return np.lib.stride_tricks.sliding_window_view(padded, length)[::HOP][: 1 + len(audio) // HOP]


def _one_octave(pitch: Floats, voiced: NDArray[np.bool_]) -> Floats:
    """Octave errors undone: what lies over an octave from the median is brought nearer by one."""
    middle = np.median(pitch[voiced])
    return pitch - (pitch > middle + 1) + (pitch < middle - 1)


def _colour(framed: Floats, power: Floats, bands: Floats) -> Floats:
    total = power.sum(axis=1) + 10 * SMALLEST_POWER
    centroid = power @ _FREQUENCIES / total
    bright = _band(power, 1000, 5000) - _band(power, 50, 1000)
    peaks = [np.log10(power[:, _between(*edges)].max(axis=1) + SMALLEST_POWER) for edges in ((0, 2000), (2000, 5000))]
    tilt = _band(power, 500, 1500) - _band(power, 0, 500)
    hiss = _band(power, 3000, 8001) - _band(power, 50, 3000)
    roll_off = _FREQUENCIES[(np.cumsum(power, axis=1) >= 0.85 * power.sum(axis=1, keepdims=True)).argmax(axis=1)]
    flux = np.concatenate([[0.0], np.sqrt(np.square(np.diff(bands, axis=0)).mean(axis=1))])
    crossings = np.diff(np.signbit(framed), axis=1).mean(axis=1)
    return np.stack([centroid, bright, peaks[0] - peaks[1], tilt, hiss, roll_off, flux, crossings], axis=1)


def _between(low_hz: float, high_hz: float) -> NDArray[np.bool_]:
    return (low_hz <= _FREQUENCIES) & (high_hz > _FREQUENCIES)


def _band(power: Floats, low_hz: float, high_hz: float) -> Floats:
    return np.log10(power[:, _between(low_hz, high_hz)].sum(axis=1) + SMALLEST_POWER)
