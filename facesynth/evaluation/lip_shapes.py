"""Lips over time as a few numbers, for classifiers that must tell motions apart."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import torch
from numpy.typing import NDArray

from facesynth.corpus import Corpus
from facesynth.evaluation.pair import Array, UnavailableError
from facesynth.evaluation.regions import lip_points
from facesynth.inference.motion import Motion
from facesynth.motion.pca import Pca

RATE = 25.0
"""Frames a second that are looked at, Hz, whatever a motion has: the rate of most video."""
COMPONENTS = 10


@dataclass(frozen=True, eq=False)
class LipShapes:
    """Principal components of the lips' points, about their own middle, each divided by its recorded deviation."""

    pca: Pca
    size: Array
    """[D]"""
    points: NDArray[np.int64]

    @classmethod
    def learn(cls, recorded: Corpus) -> Self:
        """From the complete frames of recordings; UnavailableError where the layout names no lips, or nothing is complete."""
        points = lip_points(recorded.layout)
        every = [_lips(utterance.motion, points) for utterance in recorded]
        frames = np.concatenate([lips[np.isfinite(lips).all(axis=1)] for lips in every]) if every else np.zeros((0, 1))
        if len(frames) < 2 * COMPONENTS:
            raise UnavailableError("the recordings hold too few frames with complete lips")
        pca = Pca.fit(frames, min(COMPONENTS, frames.shape[1]))
        coordinates = pca.encode(torch.from_numpy(frames.astype(np.float32))).numpy().astype(np.float64)
        return cls(pca, coordinates.std(axis=0).clip(1e-9), points)

    def of(self, motion: Motion) -> Array:
        """[T, D] at RATE; NaN where a lip point is missing."""
        lips = _lips(motion, self.points).astype(np.float32)
        coordinates = self.pca.encode(torch.from_numpy(lips)).numpy().astype(np.float64) / self.size
        count = max(1, round(len(motion) / motion.fps * RATE))
        at, known = np.minimum(np.arange(count) / RATE * motion.fps, len(motion) - 1), np.arange(len(motion))
        return np.stack([np.interp(at, known, column) for column in coordinates.T], axis=1)


def windows(signal: NDArray[Any], length: int) -> NDArray[Any]:
    """[T - length + 1, length, D] every stretch of frames [T, D]; none of a signal that is shorter."""
    if len(signal) < length:
        return np.zeros((0, length, signal.shape[1]), signal.dtype)
    return np.moveaxis(np.lib.stride_tricks.sliding_window_view(signal, length, axis=0), -1, 1)


def _lips(motion: Motion, points: NDArray[np.int64]) -> Array:
    """[T, points * dimension] lip points, of layouts in space about their own middle over the motion."""
    lips = motion.points[:, points].astype(np.float64)
    if motion.layout.dimension > 1:
        lips = lips - np.nanmean(lips, axis=(0, 1), keepdims=True)
    return lips.reshape(len(lips), -1)
