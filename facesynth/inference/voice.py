"""Statistics of a voice by which emotions differ: the arithmetic behind an emotion detector's features."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .errors import FacesynthError

RATE, HOP, WINDOW, FFT = 16000, 160, 400, 512
PITCH_WINDOW, PITCH_FFT = 800, 2048
LOWEST_HZ, HIGHEST_HZ = 65, 500
OCTAVE_COST, VOICED, QUIETER_DB = 0.02, 0.55, 35.0
LEAST_FRAMES, SMALLEST_POWER = 10, 1e-8
STRETCHES = 5
MODULATION_HZ = ((0.5, 2), (2, 4), (4, 8), (8, 16), (16, 32))

Floats = NDArray[np.float64]
FrontEnd = Callable[[NDArray[np.float32]], tuple[Floats, Floats, Floats]]
"""Sound [S] to power [T, 257], log mel bands [T, 40] and cepstra [T, 20]."""
_FREQUENCIES = np.arange(FFT // 2 + 1) * RATE / FFT


@dataclass(frozen=True, eq=False)
class Contours:
    """T frames at 100 Hz; see facesynth's contours, whose fields these are."""

    bands: Floats
    cepstra: Floats
    level: Floats
    pitch: Floats
    periodicity: Floats
    voiced: NDArray[np.bool_]
    colour: Floats


def require_voice(audio: Floats) -> None:
    """FacesynthError where sound [S] at 16 kHz is constant or too short."""
    if len(audio) >= LEAST_FRAMES * HOP and float(np.ptp(audio)) >= 1e-4:
        return
    what = "constant (silence?)" if len(audio) >= LEAST_FRAMES * HOP else f"only {len(audio) / RATE * 1000:.0f} ms long"
    raise FacesynthError(f"the sound is {what}; to detect an emotion, somebody must speak for at least {LEAST_FRAMES * 10} ms")


def voice_features(audio: NDArray[np.float32], front: FrontEnd) -> Floats:
    """Audio [S] at 16 kHz to [187]: timbre, pitch, dynamics, colour of the voiced, rhythm, course."""
    require_voice(audio.astype(np.float64))
    voice = contours(audio, front)
    parts = (_timbre(voice), _melody(voice), _dynamics(voice), _colours(voice), _rhythm(voice), _course(voice))
    return np.concatenate(parts)


def contours(audio: NDArray[np.float32], front: FrontEnd) -> Contours:
    """What the voice does over time, silence at both ends left out."""
    power, bands, cepstra = front(audio)
    sound = audio.astype(np.float64)
    level = np.log10(power.sum(axis=1) + 10 * SMALLEST_POWER)
    loud = np.flatnonzero(level > level.max() - QUIETER_DB / 10)
    kept = slice(loud[0], max(loud[-1] + 1, loud[0] + LEAST_FRAMES))
    pitch, periodicity = _pitch(_frames(sound, PITCH_WINDOW)[kept])
    voiced = periodicity > VOICED
    if voiced.sum() < 5:
        voiced = periodicity >= np.sort(periodicity)[-5]
    middle = np.median(pitch[voiced])
    pitch = pitch - (pitch > middle + 1) + (pitch < middle - 1)
    colour = _colour(_frames(sound, WINDOW)[kept], power[kept], bands[kept])
    return Contours(bands[kept], cepstra[kept], level[kept] - level.max(), pitch, periodicity, voiced, colour)


def _frames(audio: Floats, length: int) -> Floats:
    padded = np.pad(audio, (length // 2, length))
    return np.lib.stride_tricks.sliding_window_view(padded, length)[::HOP][: 1 + len(audio) // HOP]


def _pitch(framed: Floats) -> tuple[Floats, Floats]:
    """Octaves above 100 Hz and periodicity [T], by the autocorrelation divided by the window's own."""
    window = np.hanning(PITCH_WINDOW)
    own = _autocorrelation(window[None])[0]
    found = _autocorrelation((framed - framed.mean(axis=1, keepdims=True)) * window)
    found = found / np.maximum(found[:, :1], 1e-9) / (own / own[0])
    shortest, longest = RATE // HIGHEST_HZ, RATE // LOWEST_HZ
    lags = np.arange(shortest, longest)
    best = (found[:, lags] - OCTAVE_COST * np.log2(lags / shortest)).argmax(axis=1)
    return np.log2(RATE / lags[best] / 100), found[np.arange(len(found)), lags[best]]


def _autocorrelation(windowed: Floats) -> Floats:
    return np.fft.irfft(np.square(np.abs(np.fft.rfft(windowed, PITCH_FFT))))[:, :PITCH_WINDOW]


def _colour(framed: Floats, power: Floats, bands: Floats) -> Floats:
    """[T, 8] centroid, slopes and roll-off of the spectrum, its flux and zero crossings."""
    centroid = power @ _FREQUENCIES / (power.sum(axis=1) + 10 * SMALLEST_POWER)
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


def _timbre(voice: Contours) -> Floats:
    padded = np.pad(voice.cepstra, ((2, 2), (0, 0)), mode="edge")
    slopes = (padded[3:-1] - padded[1:-3] + 2 * (padded[4:] - padded[:-4])) / 10
    shape = voice.cepstra[:, 1:]
    return np.concatenate([shape.mean(axis=0), shape.std(axis=0), slopes.std(axis=0)])


def _melody(voice: Contours) -> Floats:
    pitch, clear = voice.pitch[voice.voiced], voice.periodicity
    place = np.linspace(-1, 1, len(pitch))
    spread = np.percentile(pitch, [5, 20, 50, 80, 95])
    bends = (np.polyfit(place, pitch, 2)[0], np.polyfit(place, pitch, 1)[0])
    span, moving = np.ptp(np.percentile(pitch, [10, 90])), np.abs(np.diff(pitch)).mean()
    clarity = (clear[voice.voiced].mean(), clear.mean())
    return np.array([pitch.mean(), pitch.std(), *spread, span, voice.voiced.mean(), moving, *clarity, *bends])


def _dynamics(voice: Contours) -> Floats:
    level = voice.level
    spread = np.percentile(level, [10, 25, 50, 75, 90])
    near = ((level > -1).mean(), (level > -2).mean())
    return np.array([level.std(), *spread, np.abs(np.diff(level)).mean(), *near, np.log(len(level) / 100)])


def _colours(voice: Contours) -> Floats:
    sounding = voice.colour[voice.voiced]
    spread = np.percentile(sounding, (10, 50, 90), axis=0).ravel()
    return np.concatenate([sounding.mean(axis=0), sounding.std(axis=0), spread])


def _rhythm(voice: Contours) -> Floats:
    bands = voice.bands.reshape(len(voice.bands), 10, -1).mean(axis=2)
    length = max(512, len(bands))
    power = np.square(np.abs(np.fft.rfft(bands - bands.mean(axis=0), length, axis=0)))
    rate_hz = np.fft.rfftfreq(length, 0.01)
    strength = [power[(rate_hz >= low) & (rate_hz < high)].mean(axis=0) / len(bands) for low, high in MODULATION_HZ]
    return np.log(np.array(strength) + 1e-6).ravel()


def _course(voice: Contours) -> Floats:
    stretches = np.array_split(np.arange(len(voice.level)), STRETCHES)
    middle = float(np.median(voice.pitch[voice.voiced]))
    heard = [voice.pitch[s][voice.voiced[s]] for s in stretches]
    pitch = [float(np.median(values)) if len(values) > 2 else middle for values in heard]
    level = np.array([voice.level[s].mean() for s in stretches])
    return np.concatenate([pitch, level - level.mean(), [voice.colour[s, 1].mean() for s in stretches]])
