"""What sound and phones lead one to expect: log-mel bands at any time, and a small network's poses."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .filters import spline_at
from .folder import Folder
from .graphs import Graph
from .phones import PHONES
from .sound import resample
from .speech import Speech

RATE, BANDS_FPS = 16000, 100.0
"""Of the sound that bands are taken from, Hz, and of the bands; band frame k is centred on k / BANDS_FPS seconds."""
POSES_FPS = 50.0
"""Frames that the network reads per second, Hz."""
PHONE_SIZE = 2.0
"""How loud a phone is beside the standardised bands of the sound."""

Floats = NDArray[np.float64]
Single = NDArray[np.float32]
Ints = NDArray[np.int64]
Bands = Callable[[Speech], Single]
"""From a speech to its log-mel bands [F, 40]."""


@dataclass(frozen=True, eq=False)
class Standard:
    """How bands are standardised."""

    mean: Single
    """[40]"""
    deviation: Single
    """[40]"""

    def at(self, bands: Single, times_s: Floats) -> Single:
        """[..., 40] bands [F, 40] at times [...] in seconds, linear between frames, held at the ends."""
        at = np.clip(times_s * BANDS_FPS, 0, len(bands) - 1)
        low = at.astype(np.int64)
        share = (at - low).astype(np.float32)[..., None]
        here, there = bands[low], bands[np.minimum(low + 1, len(bands) - 1)]
        return np.asarray((here + share * (there - here) - self.mean) / self.deviation, np.float32)


@dataclass(frozen=True, eq=False)
class Expectation:
    """The network behind `pose_weight`."""

    network: Callable[[Single], Single]
    """What `heard` gives [F, W] to coordinates [F, D], both at POSES_FPS."""
    standard: Standard
    emotion_count: int

    def poses(self, bands: Single, said: Sequence[int], ends_s: Floats, felt: Sequence[int], fps: float, count: int) -> Floats:
        """[count, D] at `fps`: bands [F, 40] of the sound, said and felt [P] the numbers of phones and emotions."""
        times_s = np.arange(int(np.ceil(count / fps * POSES_FPS)) + 2) / POSES_FPS
        predicted = self.network(heard(bands, said, ends_s, felt, times_s, self.standard, self.emotion_count))
        return spline_at(predicted.astype(np.float64), np.arange(count) / fps * POSES_FPS)


def heard(
    bands: Single,
    said: Sequence[int],
    ends_s: Floats,
    felt: Sequence[int],
    times_s: Floats,
    standard: Standard,
    emotion_count: int,
) -> Single:
    """[F, 40 + phones + emotions] what the network is told at times [F]."""
    number = np.minimum(np.searchsorted(ends_s, times_s, side="right"), len(said) - 1)
    phones = PHONE_SIZE * np.eye(len(PHONES), dtype=np.float32)[np.asarray(said)[number]]
    emotions = np.eye(emotion_count, dtype=np.float32)[np.asarray(felt)[number]]
    return np.hstack([standard.at(bands, times_s), phones, emotions]).astype(np.float32)


def exported_bands(folder: Folder, threads: int) -> Bands:
    """The bands of a folder's graph `log_mel`."""
    graph = Graph(folder, "log_mel", threads)

    def bands(speech: Speech) -> Single:
        sound = resample(speech.audio, speech.sample_rate, RATE)
        return np.asarray(graph(audio=sound[None])[0][0], np.float32)

    return bands


def exported_expectation(folder: Folder, arrays: Mapping[str, NDArray[Any]], threads: int) -> Expectation:
    """The network of a folder's graph `expectation`."""
    graph = Graph(folder, "expectation", threads)

    def network(told: Single) -> Single:
        return np.asarray(graph(heard=told[None])[0][0])

    standard = Standard(arrays["expectation_mean"], arrays["expectation_deviation"])
    return Expectation(network, standard, len(folder.manifest["emotions"]))
