"""The real cepstrum of a whole sound; torchaudio has cepstra of mel bands only."""

import torch
from torch import Tensor, nn
from torch.nn import functional

from facesynth.inference.errors import FacesynthError

SMALLEST_MAGNITUDE = 1e-10
"""Spectral magnitudes are not taken to be smaller: the logarithm of digital silence is finite."""


class RealCepstrum(nn.Module):
    """The first `coefficients` of `irfft(log |rfft(x)|)`, the whole sound being one frame.

    Sounds shorter than `2 * coefficients` samples are padded with zeros to that length.
    """

    def __init__(self, coefficients: int = 500) -> None:
        super().__init__()
        if coefficients < 1:
            raise FacesynthError(f"a cepstrum needs at least one coefficient; got {coefficients}")
        self.coefficients = coefficients

    def forward(self, audio: Tensor) -> Tensor:
        """Audio [..., S] to cepstral coefficients [..., coefficients], c0 first, in the sound's precision."""
        missing = max(0, 2 * self.coefficients - audio.shape[-1])
        padded = functional.pad(audio, (0, missing + (audio.shape[-1] + missing) % 2))
        magnitude = torch.fft.rfft(padded).abs().clamp(min=SMALLEST_MAGNITUDE)
        return torch.fft.irfft(magnitude.log(), padded.shape[-1])[..., : self.coefficients]
