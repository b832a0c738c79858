"""Linear regression from the sound around a frame to its pose, beside the network of poses.

They err in different places, before strangers' voices too: the network is one of many that training might have ended in, least
squares have one solution. Their weighted mean is nearer than either (docs/frontier.md).
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from facesynth.inference.expectation import EACH, Reading
from facesynth.methods.learn.regression import Moments
from facesynth.methods.learn.windows import Recording

SHARE = 0.4
"""How much of the pose is the regression's; the network's is the rest."""
AMONG_EMOTIONS = 0.5
"""What that is multiplied by where several emotions were recorded: they change how a sound is said, which it cannot know."""
SIDE = 5
"""Frames of the sound on either side of a frame that are heard, as far as may be looked ahead."""
PENALTIES = 10.0 ** np.arange(-3, 2.1, 0.5)
"""Tried, as shares of the mean variance of an input."""
CHOOSING = 5
"""Every so many-th recording chooses the penalty, unless there are fewer."""


class LinearPath(nn.Module):
    """A causal convolution over bands whose input runs ahead as the network's does; nothing until it has learned."""

    weight: Tensor
    """[R, B, K] latest frame last; of 16 bits, a tenth of the model's size."""
    bias: Tensor
    """[R]"""
    emotions: Tensor
    """[E, R] where the poses of each emotion lie, which a sound tells a regression little of; none where one was recorded."""

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer("weight", torch.zeros(0, 0, 0, dtype=torch.float16))
        self.register_buffer("bias", torch.zeros(0))
        self.register_buffer("emotions", torch.zeros(0, 0))

    @property
    def learned(self) -> bool:
        """Whether it says anything."""
        return self.bias.numel() > 0

    @property
    def share(self) -> float:
        """How much of the pose is the regression's."""
        return SHARE * (AMONG_EMOTIONS if len(self.emotions) else 1.0)

    def forward(self, told: Tensor, ahead: int) -> Tensor:
        """[F, W] what the network is told, `ahead` frames early, to components [F, R]."""
        _, bands, count = self.weight.shape
        heard = told[:, : EACH * bands].reshape(len(told), EACH, bands).mean(dim=1)
        back = count - 1 + max(ahead - SIDE, 0)
        padded = functional.pad(heard.T[None], (back, 0))
        found: Tensor = functional.conv1d(padded, self.weight.float(), self.bias)[0, :, : len(told)].T
        if not len(self.emotions):
            return found
        felt = functional.pad(told[:, -len(self.emotions) :], (0, 0, ahead, 0))[: len(told)]
        return found + felt @ self.emotions

    def learn(self, recordings: Sequence[Recording], reading: Reading, ahead: int) -> None:
        """Least squares over all frames that were recorded; the penalty predicts a fifth of the recordings best.

        Where there are changed sounds, that fifth is heard in these: voices that least squares have not met, as a stranger's is.
        """
        bands = len(reading.standard.mean)
        offsets = np.arange(-SIDE, min(SIDE, ahead) + 1)
        learned, choosing, changed = (Moments.zero(len(offsets) * bands, recordings[0].poses.shape[1]) for _ in range(3))
        emotions = _by_emotion(recordings, reading)
        for number, recording in enumerate(recordings):
            chooses = number % CHOOSING == 0 and len(recordings) > 1
            (choosing if chooses else learned).add(*_samples(recording, recording.bands, reading, offsets, emotions))
            for other in recording.others * chooses:
                changed.add(*_samples(recording, other, reading, offsets, emotions))
        judge = changed if changed.count else choosing
        errors = [judge.error(*solution) for solution in learned.solutions(PENALTIES)] if judge.count else [0.0]
        weights, bias = (learned + choosing).solution(PENALTIES[int(np.argmin(errors))])
        shaped = weights.reshape(len(offsets), bands, -1).transpose(2, 1, 0)
        self.weight = torch.from_numpy(np.ascontiguousarray(shaped)).to(self.weight)
        self.bias = torch.from_numpy(bias).to(self.bias)
        self.emotions = torch.from_numpy(emotions).to(self.bias)


def _samples(
    recording: Recording, bands: NDArray[Any], reading: Reading, offsets: NDArray[np.int64], emotions: NDArray[np.float64]
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Sound [F, B] around each recorded frame [n, K B], and its components [n, R] beside those of its emotion, of [E, R]."""
    times_s = np.arange(len(recording.poses)) / recording.fps
    around = (np.arange(EACH) - (EACH - 1) / 2) / (EACH * reading.rate)
    at = times_s[:, None, None] + (offsets / reading.rate)[:, None] + around
    heard = reading.standard.at(bands, at).mean(axis=2)  # [T, K, B]
    present = recording.present > 0
    poses = recording.poses - _felt(recording) @ emotions if len(emotions) else recording.poses
    return heard.reshape(len(heard), -1)[present], poses[present]


def _by_emotion(recordings: Sequence[Recording], reading: Reading) -> NDArray[np.float64]:
    """[E, R] by least squares from how much of each emotion is felt; [0, R] where one alone was recorded."""
    felt_at_all = {int(one) for recording in recordings for one in np.flatnonzero(recording.said.emotions.any(axis=0))}
    count = reading.emotion_count if len(felt_at_all) > 1 else 0
    squares, products = np.eye(count) * 1e-6, np.zeros((count, recordings[0].poses.shape[1]))
    for recording in recordings if count else ():
        present = recording.present > 0
        felt = _felt(recording)[present].astype(np.float64)
        squares, products = squares + felt.T @ felt, products + felt.T @ recording.poses[present]
    return np.asarray(np.linalg.solve(squares, products))


def _felt(recording: Recording) -> NDArray[np.float32]:
    """[T, E] how much of each emotion is felt in each frame."""
    times_s, ends_s = np.arange(len(recording.poses)) / recording.fps, recording.said.ends_s
    return recording.said.emotions[np.minimum(np.searchsorted(ends_s, times_s, side="right"), len(ends_s) - 1)]
