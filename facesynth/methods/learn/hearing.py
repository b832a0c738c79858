"""What the regressions hear: standardised log-mel bands around a time."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from facesynth.corpus import Corpus
from facesynth.inference.expectation import Standard
from facesynth.inference.sound import resample
from facesynth.inference.speech import Speech
from facesynth.speech.mel import LogMel


class Hearing(nn.Module):
    """40 log-mel bands of a speech at any times, each band with mean 0 and deviation 1 over the training speech."""

    mean: Tensor
    """[40]"""
    deviation: Tensor
    """[40]"""

    def __init__(self) -> None:
        super().__init__()
        self.mel = LogMel(bands=40)
        self.register_buffer("mean", torch.zeros(self.mel.bands))
        self.register_buffer("deviation", torch.ones(self.mel.bands))

    def learn(self, corpus: Corpus) -> None:
        """Take mean and deviation of each band from all sounds of a corpus."""
        count, total, squares = 0, np.zeros(self.mel.bands), np.zeros(self.mel.bands)
        for utterance in corpus:
            bands = self.bands(utterance.speech).astype(np.float64)
            count, total, squares = count + len(bands), total + bands.sum(axis=0), squares + np.square(bands).sum(axis=0)
        mean = torch.from_numpy(total / count)
        self.mean = mean.float().to(self.mean.device)
        self.deviation = (torch.from_numpy(squares / count) - mean.square()).clamp(min=1e-4).sqrt().float().to(self.mean.device)

    def at(self, speech: Speech, times_s: NDArray[np.float64]) -> Tensor:
        """Standardised bands [..., 40] at times [...] (s); times outside the sound get its first or last frame."""
        return torch.from_numpy(self.standard().at(self.bands(speech), times_s)).to(self.mean.device)

    def standard(self) -> Standard:
        """Mean and deviation as arrays."""
        return Standard(self.mean.cpu().numpy(), self.deviation.cpu().numpy())

    @torch.no_grad()
    def bands(self, speech: Speech) -> NDArray[np.float32]:
        """[F, 40] of a speech, not standardised."""
        audio = resample(speech.audio, speech.sample_rate, self.mel.sample_rate)
        heard: NDArray[Any] = self.mel(torch.from_numpy(np.ascontiguousarray(audio)).to(self.mel.window.device)).cpu().numpy()
        return heard
