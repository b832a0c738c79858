"""What sound and phones lead one to expect: log-mel bands at any time, and a small network's poses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .filters import spline_at
from .folder import Folder
from .graphs import Graph
from .sound import resample

RATE, BANDS_FPS = 16000, 100.0
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Bands:
    """40 log-mel bands of a sound, read at any time."""

    def __init__(self, folder: Folder, threads: int) -> None:
        self._graph = Graph(folder, "log_mel", threads)

    def of(self, speech: Any) -> NDArray[np.float32]:
        """[F, 40] of a speech."""
        sound = resample(speech.audio, speech.sample_rate, RATE)
        return np.asarray(self._graph(audio=sound[None])[0][0], np.float32)


def standardised(
    bands: NDArray[np.float32], times_s: Floats, mean: NDArray[np.float32], deviation: NDArray[np.float32]
) -> NDArray[np.float32]:
    """[..., 40] bands [F, 40] at times [...] in seconds, linear between frames, held at the ends."""
    at = np.clip(times_s * BANDS_FPS, 0, len(bands) - 1)
    low = at.astype(np.int64)
    share = (at - low).astype(np.float32)[..., None]
    here, there = bands[low], bands[np.minimum(low + 1, len(bands) - 1)]
    return np.asarray((here + share * (there - here) - mean) / deviation, np.float32)


class Expectation:
    """The network behind `pose_weight`."""

    def __init__(self, folder: Folder, arrays: Mapping[str, NDArray[Any]], threads: int) -> None:
        settings = folder.settings
        self.fps, self.phone_size = float(settings["expectation_fps"]), float(settings["phone_size"])
        self.phone_count, self.emotion_count = len(folder.manifest["phones"]), len(folder.manifest["emotions"])
        self._mean, self._deviation = arrays["expectation_mean"], arrays["expectation_deviation"]
        self._graph = Graph(folder, "expectation", threads)

    def poses(
        self, bands: NDArray[np.float32], said: Sequence[int], ends_s: Floats, felt: Sequence[int], fps: float, count: int
    ) -> Floats:
        """[count, D] at `fps`: bands [F, 40] of the sound, said and felt [P] the numbers of phones and emotions."""
        times_s = np.arange(int(np.ceil(count / fps * self.fps)) + 2) / self.fps
        number = np.minimum(np.searchsorted(ends_s, times_s, side="right"), len(said) - 1)
        phones = self.phone_size * np.eye(self.phone_count, dtype=np.float32)[np.asarray(said)[number]]
        emotions = np.eye(self.emotion_count, dtype=np.float32)[np.asarray(felt)[number]]
        heard = np.hstack([standardised(bands, times_s, self._mean, self._deviation), phones, emotions])
        predicted = self._graph(heard=heard[None].astype(np.float32))[0][0].astype(np.float64)
        return spline_at(predicted, np.arange(count) / fps * self.fps)
