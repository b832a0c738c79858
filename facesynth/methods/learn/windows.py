"""Windows of recordings to train the network of poses on: what is told, what moved, and the changes that make it sturdy."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from facesynth.inference.expectation import EACH, Reading, Said

WINDOW, BATCH = 64, 16
"""Frames of a window, and windows of a step."""
OVERHANG = 8
"""Frames by which a window may hang over the ends of a recording, so that its first and last frames are learned as well."""
LOUDNESS, NOISE = 0.15, 0.1
"""Deviation of a window's gain and of noise in its bands, in deviations of the bands."""
MASKED, MASK_SHARE = 8, 0.5
"""Of the 64 bands so many neighbours fall silent, in this share of the windows."""
TEMPO = 0.1
"""Windows are said so much faster or slower at most."""

Single = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Recording:
    """One utterance to learn from."""

    bands: Single
    """[F, B] of its sound, BANDS_FPS a second."""
    others: tuple[NDArray[np.float16], ...]
    """The same [F, B] as other people, microphones and rooms would have made it; see `other_voices`."""
    said: Said
    poses: Single
    """[T, R] components of the motion at its own rate; what is missing is 0."""
    present: Single
    """[T] 1 where the recording has a complete frame, 0 elsewhere."""
    fps: float

    @property
    def duration_s(self) -> float:
        """Of the motion."""
        return len(self.poses) / self.fps


class Batch(NamedTuple):
    """Windows to train on; the input runs ahead of the poses."""

    told: Tensor
    """[B, WINDOW + ahead, W]"""
    poses: Tensor
    """[B, WINDOW, R]"""
    present: Tensor
    """[B, WINDOW]"""

    def to(self, device: torch.device) -> Self:
        """On a device."""
        return type(self)(*(part.to(device) for part in self))


class Windows:
    """Draws batches of windows of recordings, longer ones more often."""

    def __init__(
        self, recordings: Sequence[Recording], reading: Reading, ahead: int, unsaid: float = 0.0, disturbed: int | None = None
    ) -> None:
        """unsaid: in this share of the windows the network is not told what is said, and must hear it.

        disturbed: of the bands, how many are changed; all unless told.
        """
        self.disturbed = disturbed
        self.recordings, self.reading, self.ahead, self.unsaid = recordings, reading, ahead, unsaid
        lengths = np.array([recording.duration_s for recording in recordings])
        self.shares = lengths / lengths.sum()

    def draw(self, rng: np.random.Generator) -> Batch:
        """BATCH windows."""
        chosen = rng.choice(len(self.recordings), BATCH, p=self.shares)
        windows = [self._window(self.recordings[i], rng) for i in chosen]
        return Batch(*(torch.from_numpy(np.stack(column)) for column in zip(*windows, strict=True)))

    def _window(self, recording: Recording, rng: np.random.Generator) -> tuple[Single, Single, Single]:
        """Sound and motion of a stretch that is said a little faster or slower."""
        rate, tempo = self.reading.rate, 1 + rng.uniform(-TEMPO, TEMPO)
        room = max(recording.duration_s * rate - WINDOW * tempo, 0) + OVERHANG
        start = rng.uniform(-OVERHANG, room)
        times_s = (start + tempo * np.arange(WINDOW + self.ahead, dtype=np.float64)) / rate
        told = self.reading.told(_any_bands(recording, rng), recording.said, times_s, tempo / (EACH * rate))
        heard = EACH * len(self.reading.standard.mean)
        told[:, :heard] = self._disturbed(told[:, :heard], rng)
        if self.unsaid and rng.random() < self.unsaid:
            told[:, heard : heard + self.reading.said_width] = 0
        poses, present = _at(recording, times_s[:WINDOW] * recording.fps)
        return told, poses, present

    def _disturbed(self, heard: Single, rng: np.random.Generator) -> Single:
        """Bands [F, EACH B] louder or softer, noisy, and some of them silent."""
        bands = heard.reshape(len(heard), EACH, -1)
        bands, others = np.split(bands, [bands.shape[2] if self.disturbed is None else self.disturbed], axis=2)
        changed = bands + LOUDNESS * rng.standard_normal() + NOISE * rng.standard_normal(bands.shape, np.float32)
        width = max(1, round(MASKED / 64 * bands.shape[2]))
        if rng.random() < MASK_SHARE:
            low = int(rng.integers(bands.shape[2] - width + 1))
            changed[:, :, low : low + width] = 0
        return np.asarray(np.concatenate([changed, others], axis=2).reshape(heard.shape), np.float32)


def _any_bands(recording: Recording, rng: np.random.Generator) -> NDArray[Any]:
    """Of its own sound or of one of the others, all of them alike."""
    number = int(rng.integers(1 + len(recording.others))) if recording.others else 0
    return recording.others[number - 1] if number else recording.bands


def _at(recording: Recording, at: NDArray[np.float64]) -> tuple[Single, Single]:
    """Poses and presence at places [F] in frames of a recording; outside of it nothing is present."""
    last = len(recording.poses) - 1
    held = np.clip(at, 0, last)
    low = held.astype(np.int64)
    high, share = np.minimum(low + 1, last), (held - low).astype(np.float32)[:, None]
    poses = recording.poses[low] + share * (recording.poses[high] - recording.poses[low])
    present = recording.present[low] * recording.present[high] * ((at >= -0.5) & (at <= last + 0.5))
    return np.asarray(poses, np.float32), present.astype(np.float32)
