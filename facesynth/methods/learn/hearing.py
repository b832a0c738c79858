"""What the regressions hear: standardised log-mel bands around a time."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from facesynth.corpus import Corpus
from facesynth.inference.sound import resample
from facesynth.inference.speech import Speech
from facesynth.speech.mel import LogMel, sample_at


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
        count, total, squares = 0, torch.zeros(self.mel.bands).double(), torch.zeros(self.mel.bands).double()
        for utterance in corpus:
            bands = self._bands(utterance.speech).double().cpu()
            count, total, squares = count + len(bands), total + bands.sum(0), squares + bands.square().sum(0)
        mean = total / count
        self.mean = mean.float()
        self.deviation = (squares / count - mean.square()).clamp(min=1e-4).sqrt().float()

    def at(self, speech: Speech, times_s: NDArray[Any]) -> Tensor:
        """Standardised bands [..., 40] at times [...] (s); times outside the sound get its first or last frame."""
        return (sample_at(self._bands(speech), self.mel.fps, times_s) - self.mean) / self.deviation

    @torch.no_grad()
    def _bands(self, speech: Speech) -> Tensor:
        audio = resample(speech.audio, speech.sample_rate, self.mel.sample_rate)
        return self.mel(torch.from_numpy(np.ascontiguousarray(audio)).to(self.mel.window.device))
