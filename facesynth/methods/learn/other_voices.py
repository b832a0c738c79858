"""A recorded sound as other people, microphones and rooms would have made it: what a network that follows strangers learns from.

One talker before one microphone teaches a network that talker's level, channel and vocal tract along with what is said. Each
change below leaves what the lips do as it is, and takes one of these away: the length of the vocal tract and the pitch (the sound
is played faster or slower, and read at the place where it came from), the microphone (a curve over frequency, a band), the room
(an exponentially decaying tail), noise, and level.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.sound import resample, resampled_length

RATE = 16000
"""Of the sound, Hz."""
SLOWEST_HZ, FASTEST_HZ, STEP_HZ = 13500, 19000, 250
"""Rates at which the sound is played: pitch and formants 16 % higher to 19 % lower."""
CURVE_DB, CURVE_OCTAVES = 6.0, 7
"""A microphone's curve: up to so much up or down at points an octave apart below 8 kHz."""
BAND_SHARE, LOWEST_HZ, HIGHEST_HZ = 0.4, (50.0, 350.0), (3400.0, 8000.0)
"""The share of sounds that lose what is below and above a band, and where its ends are drawn from."""
ROOM_SHARE, DECAY_S, TAIL_DB = 0.5, (0.1, 0.6), (-18.0, -3.0)
"""The share heard in a room, the time in which its tail falls by 60 dB, and its energy beside that of the direct sound."""
NOISE_SHARE, NOISE_DB = 0.7, (8.0, 35.0)
"""The share with noise, and how far it lies below the sound."""
LEVEL_DB = (-30.0, 6.0)

Single = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Change:
    """What is drawn of one changed sound."""

    rate: int
    """At which the sound is played, Hz."""
    curve_db: NDArray[np.float64]
    """[CURVE_OCTAVES + 1]"""
    band_hz: tuple[float, float] | None
    """What is left of the sound; None: all of it."""
    tail: NDArray[np.float64] | None
    """Of the room, beside the direct sound; None: no room."""
    hiss: NDArray[np.float64] | None
    """White noise as long as the sound; None: no noise."""
    fall: float
    """Exponent over frequency by which that falls."""
    below_db: float
    level_db: float

    @classmethod
    def drawn(cls, samples: int, rng: np.random.Generator) -> Self:
        """Of a sound of so many samples at RATE. As much is drawn whatever is left out."""
        rate = int(rng.integers(SLOWEST_HZ // STEP_HZ, FASTEST_HZ // STEP_HZ + 1)) * STEP_HZ
        curve_db = rng.uniform(-CURVE_DB, CURVE_DB, CURVE_OCTAVES + 1)
        band_hz = rng.uniform(*LOWEST_HZ), rng.uniform(*HIGHEST_HZ)
        banded = rng.random() < BAND_SHARE
        tail = _tail(rng)
        roomy = rng.random() < ROOM_SHARE
        fall, hiss = rng.uniform(0, 1), rng.standard_normal(resampled_length(samples, RATE, rate))
        below_db = rng.uniform(*NOISE_DB)
        noisy = rng.random() < NOISE_SHARE
        kept = band_hz if banded else None, tail if roomy else None, hiss if noisy else None
        return cls(rate, curve_db, *kept, fall, below_db, rng.uniform(*LEVEL_DB))


def other_voice(sound: Single, rng: np.random.Generator) -> tuple[Single, float]:
    """A changed sound [S'] of one [S] at RATE, and how many seconds of the old one a second of it says."""
    change = Change.drawn(len(sound), rng)
    played = resample(sound, RATE, change.rate).astype(np.float64)
    heard = _in_noise(_in_room(_through_microphone(played, change), change), change)
    loud = 10 ** (change.level_db / 20) * heard
    return np.clip(loud, -1, 1).astype(np.float32), len(sound) / len(played)


def _tail(rng: np.random.Generator) -> NDArray[np.float64]:
    """Noise that decays exponentially, as a room's sound does."""
    decay_s, tail_db = rng.uniform(*DECAY_S), rng.uniform(*TAIL_DB)
    tail = rng.standard_normal(int(decay_s * RATE)) * 10 ** (-3 * np.arange(int(decay_s * RATE)) / (decay_s * RATE))
    return tail * (10 ** (tail_db / 20) / np.linalg.norm(tail))


def _through_microphone(sound: NDArray[np.float64], change: Change) -> NDArray[np.float64]:
    """Louder and softer over frequency, and within a band."""
    hz = np.fft.rfftfreq(len(sound), 1 / RATE)
    octaves = np.log2(np.maximum(hz, 1) / (RATE / 2)) + CURVE_OCTAVES
    gain = 10 ** (np.interp(octaves, np.arange(CURVE_OCTAVES + 1), change.curve_db) / 20)
    if change.band_hz is not None:
        low, high = change.band_hz
        gain = gain / np.sqrt((1 + (low / np.maximum(hz, 1)) ** 8) * (1 + (hz / high) ** 16))
    return np.fft.irfft(np.fft.rfft(sound) * gain, len(sound))


def _in_room(sound: NDArray[np.float64], change: Change) -> NDArray[np.float64]:
    """With the room's tail."""
    if change.tail is None:
        return sound
    size = len(sound) + len(change.tail)
    return sound + np.fft.irfft(np.fft.rfft(sound, size) * np.fft.rfft(change.tail, size), size)[: len(sound)]


def _in_noise(sound: NDArray[np.float64], change: Change) -> NDArray[np.float64]:
    """With noise that falls by 0 to 6 dB an octave."""
    if change.hiss is None:
        return sound
    hz = np.fft.rfftfreq(len(sound), 1 / RATE)
    noise = np.fft.irfft(np.fft.rfft(change.hiss) * np.maximum(hz, 50.0) ** -change.fall, len(sound))
    return sound + noise * 10 ** (-change.below_db / 20) * np.sqrt(np.mean(sound**2) / np.mean(noise**2))
