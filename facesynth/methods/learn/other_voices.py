"""A recorded sound as other people, microphones and rooms would have made it: what a network that follows strangers learns from.

One talker before one microphone teaches a network that talker's level, channel and vocal tract along with what is said. Each
change below leaves what the lips do as it is, and takes one of these away: the length of the vocal tract and the pitch (the sound
is played faster or slower, and read at the place where it came from), the microphone (a curve over frequency, a band), the room
(an exponentially decaying tail), noise, and level.
"""

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.sound import resample

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


def other_voice(sound: Single, rng: np.random.Generator) -> tuple[Single, float]:
    """A changed sound [S'] of one [S] at RATE, and how many seconds of the old one a second of it says."""
    rate = int(rng.integers(SLOWEST_HZ // STEP_HZ, FASTEST_HZ // STEP_HZ + 1)) * STEP_HZ
    played = resample(sound, RATE, rate).astype(np.float64)
    heard = _in_noise(_in_room(_through_microphone(played, rng), rng), rng)
    loud = 10 ** (rng.uniform(*LEVEL_DB) / 20) * heard
    return np.clip(loud, -1, 1).astype(np.float32), len(sound) / len(played)


def _through_microphone(sound: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """Louder and softer over frequency, and within a band."""
    hz = np.fft.rfftfreq(len(sound), 1 / RATE)
    octaves = np.log2(np.maximum(hz, 1) / (RATE / 2)) + CURVE_OCTAVES
    gain = 10 ** (np.interp(octaves, np.arange(CURVE_OCTAVES + 1), rng.uniform(-CURVE_DB, CURVE_DB, CURVE_OCTAVES + 1)) / 20)
    low, high = rng.uniform(*LOWEST_HZ), rng.uniform(*HIGHEST_HZ)
    if rng.random() < BAND_SHARE:
        gain = gain / np.sqrt((1 + (low / np.maximum(hz, 1)) ** 8) * (1 + (hz / high) ** 16))
    return np.fft.irfft(np.fft.rfft(sound) * gain, len(sound))


def _in_room(sound: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """With a tail of noise that decays exponentially."""
    decay_s, tail_db = rng.uniform(*DECAY_S), rng.uniform(*TAIL_DB)
    tail = rng.standard_normal(int(decay_s * RATE)) * 10 ** (-3 * np.arange(int(decay_s * RATE)) / (decay_s * RATE))
    if rng.random() >= ROOM_SHARE:
        return sound
    tail *= 10 ** (tail_db / 20) / np.linalg.norm(tail)
    size = len(sound) + len(tail)
    return sound + np.fft.irfft(np.fft.rfft(sound, size) * np.fft.rfft(tail, size), size)[: len(sound)]


def _in_noise(sound: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """With noise that falls by 0 to 6 dB an octave."""
    hz = np.fft.rfftfreq(len(sound), 1 / RATE)
    falling = np.maximum(hz, 50.0) ** -rng.uniform(0, 1)
    noise = np.fft.irfft(np.fft.rfft(rng.standard_normal(len(sound))) * falling, len(sound))
    below_db = rng.uniform(*NOISE_DB)
    if rng.random() >= NOISE_SHARE:
        return sound
    return sound + noise * 10 ** (-below_db / 20) * np.sqrt(np.mean(sound**2) / np.mean(noise**2))
