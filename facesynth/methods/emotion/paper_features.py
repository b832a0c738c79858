"""The features of Cao 2005, §6: three moments of the signal and its real cepstrum."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from facesynth.speech.cepstrum import RealCepstrum


def paper_features(audio: NDArray[np.float64], coefficients: int = 500) -> NDArray[np.float64]:
    """Audio [S] at 16 kHz to [3 + coefficients]: mean, variance, root mean square, cepstrum of the whole utterance."""
    moments = [audio.mean(), audio.var(), np.sqrt(np.mean(np.square(audio)))]
    return np.concatenate([moments, RealCepstrum(coefficients)(torch.from_numpy(audio)).numpy()])
