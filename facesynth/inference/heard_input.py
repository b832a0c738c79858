"""The input of a linear system, where a regression over what is heard around each frame gives it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .ear import RATE
from .expectation import BANDS_FPS, linear_at
from .folder import Folder
from .heard import HOP, Listening, exported_listening

SIDE_S = 0.2
"""How far before and after a frame the sound is heard, s."""
ARRAYS = ("weights", "bias", "low", "high")
Single = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class HeardInput:
    """u(t) = b + Σ_k h(t + τ_k) W_k, held to the range that was seen in training; τ_k evenly spaced over ±SIDE_S."""

    listening: Listening
    """Sound to features h [F, W], BANDS_FPS a second."""
    fps: float
    """Frames per second of the system."""
    weights: Single
    """[N, W, m]"""
    bias: Single
    """[m]"""
    low: Single
    """[m] least value seen."""
    high: Single
    """[m] largest value seen."""

    def at(self, heard: Single, first: int, stop: int, heard_from: int = 0) -> Single:
        """[stop - first, m] of frames, from features [F, W] of which the first is number `heard_from`, held at the ends."""
        times_s = np.arange(first, stop) / self.fps
        total = np.zeros((len(times_s), len(self.bias)), np.float32) + self.bias
        for around_s, weights in zip(np.linspace(-SIDE_S, SIDE_S, len(self.weights)), self.weights, strict=True):
            places = np.clip((times_s + around_s) * BANDS_FPS - heard_from, 0, len(heard) - 1)
            total += linear_at(heard, places) @ weights
        return np.clip(total, self.low, self.high)

    def first_needed(self, frame: int) -> int:
        """Number of the first feature that a frame and those after it need."""
        return max(0, int(np.floor((frame / self.fps - SIDE_S) * BANDS_FPS)))

    def frames_known(self, features: int) -> int:
        """How many frames are final once so many features are."""
        return max(0, int(np.floor(((features - 1) / BANDS_FPS - SIDE_S) * self.fps + 1e-9)) + 1)

    def look_ahead_s(self, ahead_s: float) -> float:
        """Frame t is final when the sound up to t / fps + this is known; ahead_s as in `Listening`."""
        return SIDE_S + self.listening.look_ahead_s(ahead_s) + HOP / RATE


def exported_input(folder: Folder, fps: float, threads: int) -> HeardInput | None:
    """Of a folder; None where its system hears periodograms."""
    if not folder.manifest["arrays"]:
        return None
    arrays = folder.arrays()
    return HeardInput(exported_listening(folder, threads), fps, *(arrays[f"heard_{name}"] for name in ARRAYS))
