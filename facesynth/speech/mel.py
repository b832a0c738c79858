"""Log-mel bands: the plainest picture of a sound that a small network or a regression can read."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

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
        filters = torch.from_numpy(mel_filters(bands, self.fft, sample_rate))
        self.register_buffer("window", torch.hann_window(length), persistent=False)
        self.register_buffer("filters", filters, persistent=False)

    @property
    def fps(self) -> float:
        """Feature frames per second, Hz; frame k is centred on k / fps seconds."""
        return self.sample_rate / self.hop

    def forward(self, audio: Tensor) -> Tensor:
        """Audio [..., S] at `sample_rate` to log energies [..., 1 + S // hop, bands]."""
        spectrum = torch.stft(
            audio.reshape(-1, audio.shape[-1]),
            self.fft,
            self.hop,
            len(self.window),
            self.window,
            pad_mode="constant",
            return_complex=True,
        )
        power = spectrum.abs().square().transpose(1, 2) / self.window.square().sum()  # [B, F, fft // 2 + 1]
        energies = torch.log(power @ self.filters + FLOOR)
        return energies.reshape(*audio.shape[:-1], *energies.shape[1:])


def mel_filters(bands: int, fft: int, sample_rate: int) -> NDArray[np.float32]:
    """[fft // 2 + 1, bands] triangles over the bins of an FFT; each rises from the centre below and falls to the next."""
    edges_mel = np.linspace(0.0, 2595 * np.log10(1 + sample_rate / 2 / 700), bands + 2)
    edges = 700 * (10 ** (edges_mel / 2595) - 1)
    bins = np.arange(fft // 2 + 1) * sample_rate / fft
    rising = (bins[:, None] - edges[:-2]) / np.diff(edges)[:-1]
    falling = (edges[2:] - bins[:, None]) / np.diff(edges)[1:]
    return np.clip(np.minimum(rising, falling), 0, None).astype(np.float32)


def sample_at(features: Tensor, fps: float, times_s: NDArray[Any]) -> Tensor:
    """Features [F, D], frame k at k / fps seconds, interpolated linearly at times [...]: [..., D]; ends are held."""
    at = torch.from_numpy(np.clip(np.asarray(times_s, np.float64) * fps, 0, len(features) - 1)).to(features.device)
    low = at.floor().long()
    share = (at - low).to(features.dtype)[..., None]
    return torch.lerp(features[low], features[(low + 1).clamp(max=len(features) - 1)], share)
