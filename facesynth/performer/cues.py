"""What in a voice moves the rest of the face and the head: loudness, pitch, accents, whether it speaks at all."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, uniform_filter1d

from facesynth.inference.phones import SILENCE, VOWELS
from facesynth.inference.speech import Speech
from facesynth.performer.prosody import FRAME_S

PITCH_SCALE = 0.25
"""A pitch this much (natural logarithm) above the speaker's median counts as 1."""
ACCENT_GAP_S = 0.5
"""Two accents are at least this far apart."""
ACCENT_S = 0.11
"""Half width of the movement that an accent makes (standard deviation)."""
ACCENT_LEAD_S = 0.03
"""Brows and head arrive this much before the middle of the vowel."""


@dataclass(frozen=True, eq=False)
class Cues:
    """Tracks over T frames."""

    loudness: NDArray[np.float64]
    """[T] RMS over 25 ms; 1 = the loud parts of the utterance."""
    pitch: NDArray[np.float64]
    """[T] about -2..2, smooth, 0 = the median of the utterance."""
    accents: NDArray[np.float64]
    """[T] bumps of height 1 at accented vowels."""
    talking: NDArray[np.float64]
    """[T] 1 in speech, 0 in silence, with soft edges."""


def listen(speech: Speech, pitch_hz: NDArray[np.float64], count: int, fps: float) -> Cues:
    """The cues of an utterance at `count` frames; pitch_hz: [F] every 5 ms, 0 where unvoiced."""
    times = np.arange(count) / fps
    loudness = _loudness(speech, times)
    pitch = _pitch(pitch_hz, times, fps)
    index = np.minimum(np.searchsorted(speech.phones.ends_s, times, side="right"), len(speech.phones) - 1)
    spoken = np.array([label != SILENCE for label in speech.phones.labels])[index].astype(np.float64)
    talking = gaussian_filter1d(spoken, 0.08 * fps, mode="nearest")
    return Cues(loudness, pitch, _accents(speech, loudness, pitch, times), talking)


def _loudness(speech: Speech, times: NDArray[np.float64]) -> NDArray[np.float64]:
    power = uniform_filter1d(speech.audio.astype(np.float64) ** 2, max(1, speech.sample_rate // 40))
    loudness = np.interp(times, np.arange(len(power)) / speech.sample_rate, np.sqrt(np.maximum(power, 0.0)))
    return loudness / (np.percentile(loudness, 80) + 1e-9)


def _pitch(pitch_hz: NDArray[np.float64], times: NDArray[np.float64], fps: float) -> NDArray[np.float64]:
    voiced = np.flatnonzero(pitch_hz > 0)
    if not len(voiced):
        return np.zeros(len(times))
    logs = np.log(pitch_hz[voiced])
    contour = np.interp(times, voiced * FRAME_S, (logs - np.median(logs)) / PITCH_SCALE)
    smooth: NDArray[np.float64] = gaussian_filter1d(np.clip(contour, -2.0, 2.0), 0.06 * fps, mode="nearest")
    return smooth


def _accents(
    speech: Speech, loudness: NDArray[np.float64], pitch: NDArray[np.float64], times: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Vowels that are louder and higher than what surrounds them, not too close to each other."""
    track = np.zeros(len(times))
    enough = 0.75 * np.percentile(loudness, 90)
    last_s = -ACCENT_GAP_S
    for label, start, end in zip(speech.phones.labels, speech.phones.starts_s, speech.phones.ends_s, strict=True):
        here = (times >= start) & (times <= end)
        if label not in VOWELS or not here.any() or end - start < 0.06 or start - last_s < ACCENT_GAP_S:
            continue
        if loudness[here].max() > enough and pitch[here].mean() > 0.2:
            track += np.exp(-0.5 * ((times - (start + end) / 2 + ACCENT_LEAD_S) / ACCENT_S) ** 2)
            last_s = start
    return track
