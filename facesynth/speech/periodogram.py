"""The periodogram of the sound of each video frame: the input of the linear dynamical system.

torchaudio's spectrogram steps by whole samples: at 29.97 frames a second it is 15 ms off the picture after a minute.
"""

import math
from typing import Literal, get_args

import torch
from torch import Tensor, nn

from facesynth.inference.errors import FacesynthError, unknown
from facesynth.inference.sound import resample
from facesynth.inference.speech import Speech
from facesynth.inference.windows import FrameWindows

Scale = Literal["linear", "log"]
RATE = 16_000
"""Hz, of the sound that is analysed."""
COEFFICIENTS = 256
"""Bins of 31.25 Hz, from 31.25 Hz to 8 kHz."""
SHORTEST_WINDOW_S = 0.032
CONTEXT_STEP_MS, LONGEST_CONTEXT_MS = 40.0, 1000.0
STEP = round(CONTEXT_STEP_MS / 1000 * RATE)
"""Samples between the windows of a context."""
FLOOR = 1e-7
"""Power, relative to full scale, under which `log` sees silence: about the noise of a 12-bit recording."""


class Periodogram(nn.Module):
    """256 coefficients of the power spectrum for each video frame (Saisan 2004, §5).

    Frame t shows what happens from t / fps to (t + 1) / fps. Its window is as long as that frame and at least 32 ms,
    and lies where `FrameWindows` says. With a context of `context_ms` before and after, windows every CONTEXT_STEP_MS of it are
    analysed in the same way, one after the other: 256 coefficients of each.
    """

    window: Tensor
    """[L] Hann window of unit energy."""

    def __init__(self, fps: float, scale: Scale = "log", lead_ms: float = 0.0, context_ms: float = 0.0) -> None:
        super().__init__()
        if not (math.isfinite(fps) and fps > 0):
            raise FacesynthError(f"fps must be positive; got {fps}")
        if scale not in get_args(Scale):
            raise unknown("periodogram scale", scale, get_args(Scale))
        if not 0 <= context_ms <= LONGEST_CONTEXT_MS:
            raise FacesynthError(f"context_ms must be 0 (the frame's sound alone) to {LONGEST_CONTEXT_MS:g}; got {context_ms!r}")
        self.fps, self.scale, self.lead_ms = fps, scale, lead_ms
        self.around = round(context_ms / CONTEXT_STEP_MS)
        length = round(RATE * max(1 / fps, SHORTEST_WINDOW_S))
        window = torch.hann_window(length, dtype=torch.float64)
        self.register_buffer("window", (window / window.square().sum().sqrt()).float())
        self.bins_each = math.ceil(length / (2 * COEFFICIENTS))

    @property
    def parts(self) -> int:
        """S, how many windows are analysed for a frame."""
        return 2 * self.around + 1

    @property
    def length(self) -> int:
        """L', samples that are heard for one frame, its context with it."""
        return len(self.window) + 2 * self.around * STEP

    @property
    def windows(self) -> FrameWindows:
        """Where the windows, context with them, lie."""
        return FrameWindows(self.fps, RATE, self.length, self.lead_ms / 1000)

    def centres(self, count: int) -> Tensor:
        """[count] sample at the middle of each frame's window, counted at 16 kHz."""
        return torch.from_numpy(self.windows.starts(0, count)) + self.length // 2

    def forward(self, audio: Tensor, count: int) -> Tensor:
        """Coefficients [count, S 256] of sound at 16 kHz, which is silent before its start and after its end."""
        length = self.length
        starts = self.centres(count).to(audio.device) - length // 2
        before = int((-starts[0]).clamp(min=0))
        after = int((starts[-1] + length - len(audio)).clamp(min=0))
        places = (starts + before)[:, None] + torch.arange(length, device=audio.device)
        return self.spectrum(nn.functional.pad(audio, (before, after))[places])

    def spectrum(self, frames: Tensor) -> Tensor:
        """Coefficients [..., S 256] of windows [..., L'].

        Windows longer than 32 ms resolve more than 256 bins; neighbours are averaged down to 256.
        """
        if self.around:
            return self._spectrum(frames.unfold(-1, len(self.window), STEP)).flatten(-2)
        return self._spectrum(frames)

    def _spectrum(self, frames: Tensor) -> Tensor:
        """[..., 256] of windows [..., L]."""
        power = torch.fft.rfft(frames * self.window, n=2 * COEFFICIENTS * self.bins_each).abs().square()
        power = power[..., 1 : 1 + COEFFICIENTS * self.bins_each].unflatten(-1, (COEFFICIENTS, self.bins_each)).mean(dim=-1)
        return power if self.scale == "linear" else torch.log(power + FLOOR)

    def of(self, speech: Speech, count: int) -> Tensor:
        """Coefficients [count, S 256] of an utterance at any sampling rate."""
        audio = torch.from_numpy(resample(speech.audio, speech.sample_rate, RATE))
        return self(audio.to(self.window.device), count)
