"""Mel bands and cepstra (MFCC) of a voice, as emotions are read from."""

import torch
from torch import Tensor, nn
from torchaudio.functional import create_dct, melscale_fbanks, spectrogram

from facesynth.inference.contours import FFT, HOP, SMALLEST_POWER, WINDOW
from facesynth.inference.pitch import RATE

BANDS, CEPSTRA = 40, 20
LOWEST_HZ = 50.0


class MelCepstra(nn.Module):
    """Power, log mel bands from 50 Hz to 8 kHz, and their cepstra, a hundred times a second, in float64.

    torchaudio's MFCC keeps its bands to itself and works in float32, which the logarithm of a quiet band feels.
    """

    window: Tensor
    """[400] Hamming, its two ends alike."""
    filters: Tensor
    """[257, 40]"""
    cosines: Tensor
    """[40, 20]"""

    def __init__(self) -> None:
        super().__init__()
        filters = melscale_fbanks(FFT // 2 + 1, LOWEST_HZ, RATE / 2, BANDS, RATE)
        self.register_buffer("window", torch.hamming_window(WINDOW, periodic=False, dtype=torch.float64), persistent=False)
        self.register_buffer("filters", filters.double(), persistent=False)
        self.register_buffer("cosines", create_dct(CEPSTRA, BANDS, "ortho").double(), persistent=False)

    def forward(self, audio: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Audio [..., S] at 16 kHz to power [..., T, 257], log bands [..., T, 40] and cepstra [..., T, 20]; T = 1 + S // 160."""
        power = spectrogram(
            audio.double(),
            pad=0,
            window=self.window,
            n_fft=FFT,
            hop_length=HOP,
            win_length=WINDOW,
            power=2.0,
            normalized=False,
            pad_mode="constant",
        ).transpose(-1, -2)
        bands = torch.log(power @ self.filters + SMALLEST_POWER)
        return power, bands, bands @ self.cosines
