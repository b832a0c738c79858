"""One voice, several feelings: rate, pitch level and range, loudness and brightness of speech changed with WORLD.

Every utterance, neutral ones too, goes through the same analysis and synthesis, so that the vocoder's sound tells nothing
about the emotion; and every take differs from the last in tempo, pitch and loudness, as an actor's would.
"""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from types import ModuleType

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import gaussian_filter1d

from facesynth.inference.errors import FacesynthError, unknown

FRAME_S = 0.005
"""WORLD's frame period, seconds."""
LEVEL_RMS = 0.08
"""Loudness of a neutral utterance, RMS of full scale."""
LARGEST_PITCH_HZ = 380.0
CREAK = 0.35
"""Pitch further than this from its median (natural logarithm) is creak or an octave slip: its range is not stretched."""
SILENT_RMS = 1e-3
"""What is weaker than this is not made louder."""
ROOM_NOISE = 3e-4
"""RMS of the background that every recording has."""


@dataclass(frozen=True)
class Prosody:
    """How an emotion changes the voice; factors are 1 and the others 0 for a neutral one."""

    level: float = 1.0
    """Factor of the pitch's median."""
    range: float = 1.0
    """Factor of the pitch's excursions (logarithm) about its median."""
    tempo: float = 1.0
    """Factor of the rate of speech."""
    loudness_db: float = 0.0
    tilt: float = 0.0
    """Brightness: exponent of the amplitude spectrum's tilt about 1 kHz, in units of 0.8."""


PROSODY: Mapping[str, Prosody] = {
    "neutral": Prosody(),
    "happy": Prosody(level=1.20, range=1.55, tempo=1.05, loudness_db=2.0, tilt=0.15),
    "angry": Prosody(level=1.10, range=1.35, tempo=1.10, loudness_db=4.5, tilt=0.4),
    "sad": Prosody(level=0.92, range=0.5, tempo=0.82, loudness_db=-4.0, tilt=-0.35),
}
EMOTIONS: tuple[str, ...] = tuple(PROSODY)
"""What the built-in performer can feel."""


@dataclass(frozen=True, eq=False)
class Analysis:
    """WORLD's description of a sound in F frames of 5 ms."""

    pitch_hz: NDArray[np.float64]
    """[F] 0 where unvoiced."""
    spectrum: NDArray[np.float64]
    """[F, B] power envelope."""
    aperiodicity: NDArray[np.float64]
    """[F, B] 0 (periodic) to 1 (noise)."""
    audio: NDArray[np.float32]
    """[S] the sound itself."""
    rate: int
    """Hz of the sound."""


def analyse(audio: NDArray[np.float32], rate: int) -> Analysis:
    """Take speech [S] apart into pitch, spectral envelope and aperiodicity."""
    pyworld = _pyworld()
    sound = np.asarray(audio, np.float64)
    pitch, times = pyworld.harvest(sound, rate, f0_floor=65.0, f0_ceil=400.0, frame_period=1000 * FRAME_S)
    spectrum = pyworld.cheaptrick(sound, pitch, times, rate)
    aperiodicity = pyworld.d4c(sound, pitch, times, rate)
    return Analysis(pitch, spectrum, aperiodicity, np.asarray(audio, np.float32), rate)


@dataclass(frozen=True, eq=False)
class Voiced:
    """A sound as it was spoken, with the pitch that was asked of it."""

    audio: NDArray[np.float32]
    """[S] mono, -1..1."""
    rate: int
    """Hz."""
    pitch_hz: NDArray[np.float64]
    """[F] every 5 ms, 0 where unvoiced."""
    calm_frames: NDArray[np.float64]
    """[F] which frame of the calm speech is heard in each frame."""

    @property
    def duration_s(self) -> float:
        """Length of the sound, seconds."""
        return len(self.audio) / self.rate

    def when(self, calm_s: ArrayLike) -> NDArray[np.float64]:
        """When a moment of the calm speech (seconds) comes in this one (seconds)."""
        frames = np.asarray(calm_s, np.float64) / FRAME_S
        return np.interp(frames, self.calm_frames, np.arange(len(self.calm_frames))) * FRAME_S


def colour(analysis: Analysis, emotion: str, seed: int) -> Voiced:
    """Speech again, in an emotion; `seed` is the take."""
    if emotion not in PROSODY:
        raise unknown("emotion of the built-in performer", emotion, PROSODY)
    rng = np.random.default_rng(seed)
    prosody = _as_taken(PROSODY[emotion], rng)
    frames = _when(len(analysis.pitch_hz), prosody.tempo, rng)
    pitch = _pitch(_at_pitch(analysis.pitch_hz, frames), prosody, rng)
    spectrum = np.exp(_at(np.log(analysis.spectrum + 1e-16), frames)) * _tilt(analysis, prosody.tilt)
    aperiodicity = np.clip(_at(analysis.aperiodicity, frames), 0.0, 1.0)
    pyworld = _pyworld()
    sound = pyworld.synthesize(pitch, np.ascontiguousarray(spectrum), aperiodicity, analysis.rate, 1000 * FRAME_S)
    return Voiced(_as_recorded(sound, prosody.loudness_db, rng), analysis.rate, pitch, frames)


def _as_taken(prosody: Prosody, rng: np.random.Generator) -> Prosody:
    """No two takes are alike: a few percent of everything."""
    level, span, tempo = np.exp(rng.normal(0.0, (0.025, 0.08, 0.03)))
    return Prosody(
        prosody.level * level,
        prosody.range * span,
        prosody.tempo * tempo,
        prosody.loudness_db + rng.normal(0.0, 0.7),
        prosody.tilt + rng.normal(0.0, 0.04),
    )


def _when(count: int, tempo: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """[F'] which source frame is heard at each new frame: the tempo, wavering by some 6 % about once a second."""
    waver = gaussian_filter1d(rng.normal(size=count), 0.25 / FRAME_S, mode="reflect")
    waver *= 0.06 / max(float(waver.std()), 1e-9)
    ends = np.cumsum(np.exp(waver) / tempo)
    return np.interp(np.arange(round(ends[-1])), ends, np.arange(count, dtype=np.float64))


def _at(values: NDArray[np.float64], frames: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rows [F', …] of `values` [F, …] at fractional frames, linearly."""
    left = np.floor(frames).astype(np.int64)
    right = np.minimum(left + 1, len(values) - 1)
    share = (frames - left)[:, None]
    return np.ascontiguousarray((1 - share) * values[left] + share * values[right])


def _at_pitch(pitch: NDArray[np.float64], frames: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pitch [F'] at fractional frames: never a mixture of voiced and unvoiced."""
    voiced = pitch > 0
    if not voiced.any():
        return np.zeros(len(frames))
    index = np.arange(len(pitch))
    contour = np.exp(np.interp(frames, index[voiced], np.log(pitch[voiced])))
    return np.where(voiced[np.round(frames).astype(np.int64)], contour, 0.0)


def _pitch(pitch: NDArray[np.float64], prosody: Prosody, rng: np.random.Generator) -> NDArray[np.float64]:
    voiced = pitch > 0
    if not voiced.any():
        return pitch
    median = np.median(pitch[voiced])
    away = np.log(pitch[voiced] / median)
    drift = gaussian_filter1d(rng.normal(size=len(pitch)), 0.3 / FRAME_S)
    drift *= 0.03 / max(float(drift.std()), 1e-9)
    moved = pitch.copy()
    moved[voiced] = median * prosody.level * np.exp(away + (prosody.range - 1) * np.clip(away, -CREAK, CREAK) + drift[voiced])
    return np.minimum(moved, LARGEST_PITCH_HZ)


def _tilt(analysis: Analysis, tilt: float) -> NDArray[np.float64]:
    """[B] factor of the power spectrum: tilted about 1 kHz, flat below 100 Hz."""
    hertz = np.linspace(0.0, analysis.rate / 2, analysis.spectrum.shape[1])
    factor: NDArray[np.float64] = np.maximum(hertz / 1000.0, 0.1) ** (2 * 0.8 * tilt)
    return factor


def _as_recorded(sound: NDArray[np.float64], loudness_db: float, rng: np.random.Generator) -> NDArray[np.float32]:
    loudness = LEVEL_RMS * 10 ** (loudness_db / 20)
    level = float(np.sqrt(np.mean(sound**2)))
    soft = np.tanh(1.1 * sound * loudness / max(level, SILENT_RMS)) / 1.1
    return (soft + rng.normal(0.0, ROOM_NOISE, len(soft))).astype(np.float32)


def _pyworld() -> ModuleType:
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "pkg_resources is deprecated", UserWarning)
            import pyworld
    except ImportError as error:
        raise FacesynthError(f"pyworld cannot be imported ({error}); pip install 'facesynth[demo]'") from None
    return pyworld
