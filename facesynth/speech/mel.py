"""Log-mel bands: the plainest picture of a sound that a small network or a regression can read."""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torchaudio.functional import melscale_fbanks, spectrogram

FLOOR = 1e-8
"""Band energy that counts as nothing, so that digital silence has a logarithm (-18.4)."""


class LogMel(nn.Module):
    """Natural logarithm of the energy in triangular bands, equally spaced in mel (O'Shaughnessy: 2595 log10(1 + f / 700)).

    Parameters
    ----------
    bands : int
        Number of bands between 0 Hz and half the rate.
    sample_rate : int
        Rate of the sound, Hz.
    window_s, hop_s : float
        Length of the Hann window and step between frames, seconds.
    """

    window: Tensor
    filters: Tensor

    def __init__(self, bands: int = 40, sample_rate: int = 16000, window_s: float = 0.025, hop_s: float = 0.010) -> None:
        super().__init__()
        self.bands, self.sample_rate, self.hop = bands, sample_rate, round(hop_s * sample_rate)
        length = round(window_s * sample_rate)
        self.fft = 1 << (length - 1).bit_length()
        filters = melscale_fbanks(self.fft // 2 + 1, 0.0, sample_rate / 2, bands, sample_rate)
        self.register_buffer("window", torch.hann_window(length), persistent=False)
        self.register_buffer("filters", filters, persistent=False)

    @property
    def fps(self) -> float:
        """Feature frames per second, Hz; frame k is centred on k / fps seconds."""
        return self.sample_rate / self.hop

    def forward(self, audio: Tensor) -> Tensor:
        """Audio [..., S] at `sample_rate` to log energies [..., 1 + S // hop, bands]."""
        power = spectrogram(
            audio,
            pad=0,
            window=self.window,
            n_fft=self.fft,
            hop_length=self.hop,
            win_length=len(self.window),
            power=2.0,
            normalized="window",
            pad_mode="constant",
        )  # [..., fft // 2 + 1, F]
        return torch.log(power.transpose(-1, -2) @ self.filters + FLOOR)


def sample_at(features: Tensor, fps: float, times_s: NDArray[Any]) -> Tensor:
    """Features [F, D], frame k at k / fps seconds, interpolated linearly at times [...]: [..., D]; ends are held."""
    at = torch.from_numpy(np.clip(np.asarray(times_s, np.float64) * fps, 0, len(features) - 1)).to(features.device)
    low = at.floor().long()
    share = (at - low).to(features.dtype)[..., None]
    return torch.lerp(features[low], features[(low + 1).clamp(max=len(features) - 1)], share)
