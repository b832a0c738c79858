"""RASTA-PLP: what is said, with the microphone and the room filtered away.

torchaudio has mel cepstra, but no critical bands, no all-pole model and no RASTA filter; its `lfilter`, which could run
the filter, keeps no state between pieces.
"""

from collections.abc import Iterator

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from facesynth.inference.errors import FacesynthError

POLE_PER_10_MS = 0.94
"""Pole of the RASTA filter at 100 frames per second (integration over about 160 ms)."""
FRAMES_TOGETHER = 1024
"""Whose spectra are there at once: 10 s."""
ROUNDING_POWER = 1.0 / (12.0 * 32768.0**2)
"""Power of the noise that rounding to 16 bits adds: the floor under digital silence."""


class RastaPlp(nn.Module):
    """Cepstra of an all-pole model of the auditory spectrum (Hermansky 1990), RASTA filtered (Hermansky, Morgan 1994).

    Parameters
    ----------
    sample_rate : int
        Rate of the sound, Hz.
    window_s, hop_s : float
        Length of the Hamming window and the step between frames, seconds.
    order : int
        Order of the all-pole model; the features are its order + 1 cepstra, c0 first.
    lift : float
        Exponent of the lifter: cepstrum n is multiplied by n ** lift, which brings all to one scale.
    """

    window: Tensor
    bands: Tensor
    loudness: Tensor
    rasta: Tensor

    def __init__(
        self, sample_rate: int = 16000, window_s: float = 0.025, hop_s: float = 0.010, order: int = 8, lift: float = 0.6
    ) -> None:
        super().__init__()
        self.sample_rate, self.hop, self.order, self.lift = sample_rate, round(hop_s * sample_rate), order, lift
        length = round(window_s * sample_rate)
        self.fft = 1 << (length - 1).bit_length()
        centres_bark = band_centres_bark(sample_rate)
        if not 1 <= order < len(centres_bark) or self.hop < 1 or length < 2:
            raise FacesynthError(
                f"RASTA-PLP at {sample_rate} Hz has {len(centres_bark)} critical bands, which allow an order of 1 to "
                f"{len(centres_bark) - 1} and a window and a hop of some samples; got order {order}, {length} and {self.hop}"
            )
        self.register_buffer("window", torch.hamming_window(length, periodic=False, dtype=torch.float64), persistent=False)
        self.register_buffer("bands", torch.from_numpy(critical_bands(sample_rate, self.fft)), persistent=False)
        self.register_buffer("loudness", torch.from_numpy(equal_loudness(centres_bark)), persistent=False)
        self.register_buffer("rasta", torch.from_numpy(rasta_response(POLE_PER_10_MS ** (hop_s / 0.010))), persistent=False)

    @property
    def fps(self) -> float:
        """Feature frames per second, Hz; frame k is centred on k / fps seconds."""
        return self.sample_rate / self.hop

    def forward(self, audio: Tensor) -> Tensor:
        """Audio [..., S], -1..1, to cepstra [..., 1 + S // hop, order + 1], float32."""
        found, earlier = [], None
        for energies in self.band_energies(audio):
            filtered, earlier = self.filter_along_time(energies.log(), earlier)
            found.append(self.cepstra(torch.exp((filtered + self.loudness.log()) / 3)).to(torch.float32))
        return torch.cat(found, dim=-2)

    def band_energies(self, audio: Tensor) -> Iterator[Tensor]:
        """Audio [..., S] to the power in each critical band [..., frames, bands], in double precision, some frames at a time."""
        count, length, half = audio.shape[-1], len(self.window), len(self.window) // 2
        frames = 1 + count // self.hop
        for first in range(0, frames, FRAMES_TOGETHER):
            start, stop = (min(k, frames) * self.hop - half for k in (first, first + FRAMES_TOGETHER))
            heard = audio[..., max(0, start) : stop + length]
            missing = max(0, -start), max(0, stop + length - count)
            windows = functional.pad(heard, missing).unfold(-1, length, self.hop)
            yield self._energies_of(windows[..., : min(FRAMES_TOGETHER, frames - first), :])

    def _energies_of(self, frames: Tensor) -> Tensor:
        power = torch.fft.rfft(frames.to(self.window.dtype) * self.window, self.fft).abs() ** 2
        floor = ROUNDING_POWER * self.window.square().sum()
        return (power + floor) @ self.bands

    def filter_along_time(self, log_energies: Tensor, earlier: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Band-pass each band's logarithm [..., frames, bands] along time; beside it what to begin with when it goes on.

        H(z) = (0.2 + 0.1 z^-1 - 0.1 z^-3 - 0.2 z^-4) / (1 - pole z^-1). A fixed linear channel adds a
        constant to the logarithm, and H(1) = 0 removes it. The impulse response is written out until it
        has fallen below 1e-9, so that the filter is one convolution. The first frame is taken to have
        lasted forever, so that no transient marks the beginning.
        """
        bands, reach = log_energies.shape[-1], len(self.rasta) - 1
        along_time = log_energies.reshape(-1, *log_energies.shape[-2:]).transpose(1, 2)
        earlier = along_time[..., :1].expand(-1, -1, reach) if earlier is None else earlier
        padded = torch.cat([earlier, along_time], dim=-1)
        kernel = self.rasta.flip(0).expand(bands, 1, -1)
        filtered = functional.conv1d(padded, kernel, groups=bands)
        return filtered.transpose(1, 2).reshape(log_energies.shape), padded[..., -reach:].clone()

    def cepstra(self, auditory: Tensor) -> Tensor:
        """Auditory spectrum [..., bands] to the cepstra [..., order + 1] of its all-pole model.

        The outermost bands reach beyond the spectrum and take their neighbours' values. The spectrum,
        mirrored, is the power spectrum of the model; its inverse transform is the autocorrelation.
        """
        inner = auditory[..., 1:-1]
        spectrum = torch.cat([inner[..., :1], inner, inner[..., -1:]], dim=-1)
        mirrored = torch.cat([spectrum, spectrum[..., 1:-1].flip(-1)], dim=-1)
        autocorrelation = torch.fft.ifft(mirrored).real[..., : self.order + 1]
        coefficients, gain = levinson_durbin(autocorrelation)
        cepstra = predictor_to_cepstra(coefficients, gain)
        lifter = torch.arange(self.order + 1, dtype=cepstra.dtype, device=cepstra.device).pow(self.lift)
        lifter[0] = 1.0
        return cepstra * lifter


def bark(frequency_hz: NDArray[np.float64] | float) -> NDArray[np.float64]:
    """Critical-band rate of a frequency, Bark (Hermansky 1990, eq. 3)."""
    return 6.0 * np.arcsinh(np.asarray(frequency_hz) / 600.0)


def band_centres_bark(sample_rate: int) -> NDArray[np.float64]:
    """[bands] centres about one Bark apart, from 0 to half the sample rate."""
    top = float(bark(sample_rate / 2))
    return np.linspace(0.0, top, int(np.ceil(top)) + 1)


def critical_bands(sample_rate: int, fft: int) -> NDArray[np.float64]:
    """[fft // 2 + 1, bands] masking curves: flat over one Bark, +25 dB/Bark below, -10 dB/Bark above (eq. 4)."""
    distance = bark(np.arange(fft // 2 + 1) * sample_rate / fft)[:, None] - band_centres_bark(sample_rate)
    return 10.0 ** np.minimum(0.0, np.minimum(2.5 * (distance + 0.5), -(distance - 0.5)))


def equal_loudness(centres_bark: NDArray[np.float64]) -> NDArray[np.float64]:
    """[bands] sensitivity of hearing at 40 dB (eq. 7, with the angular frequencies written in Hz).

    The first band lies at 0 Hz, where it would be 0; its value is never used and is set to its neighbour's.
    """
    squared = (600.0 * np.sinh(centres_bark / 6.0)) ** 2
    curve = (squared / (squared + 1.6e5)) ** 2 * (squared + 1.44e6) / (squared + 9.61e6)
    return np.concatenate([curve[1:2], curve[1:]])


def rasta_response(pole: float) -> NDArray[np.float64]:
    """Impulse response of the RASTA filter, written out until it has fallen below 1e-9."""
    length = 5 + int(np.ceil(np.log(1e-9) / np.log(pole)))
    decay = pole ** np.arange(length)
    return np.convolve([0.2, 0.1, 0.0, -0.1, -0.2], decay)[:length]


def levinson_durbin(autocorrelation: Tensor) -> tuple[Tensor, Tensor]:
    """Autocorrelation [..., p + 1] to predictor polynomial [..., p + 1] (first entry 1) and error power [...]."""
    order = autocorrelation.shape[-1] - 1
    error = autocorrelation[..., 0]
    polynomial = torch.ones_like(autocorrelation[..., :1])
    for m in range(1, order + 1):
        reflection = -(polynomial * autocorrelation[..., 1 : m + 1].flip(-1)).sum(-1) / error
        longer = functional.pad(polynomial, (0, 1))
        polynomial = longer + reflection[..., None] * longer.flip(-1)
        error = error * (1.0 - reflection.square())
    return polynomial, error


def predictor_to_cepstra(polynomial: Tensor, gain: Tensor) -> Tensor:
    """Cepstra [..., p + 1] of gain / |A|²: c0 = log gain, c_n = -a_n - sum over k < n of (k / n) c_k a_(n-k)."""
    cepstra = [gain.log()]
    for n in range(1, polynomial.shape[-1]):
        earlier = sum((k / n * cepstra[k] * polynomial[..., n - k] for k in range(1, n)), torch.zeros_like(gain))
        cepstra.append(-polynomial[..., n] - earlier)
    return torch.stack(cepstra, dim=-1)
