"""The network that hears phones of any speaker and language: sound in, probabilities of IPA tokens and hidden layers out."""

from functools import cache
from typing import Any

import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from facesynth.speech.phone_archive import PhoneArchive, read_archive
from facesynth.speech.phone_weights import BANDS, BLOCKS, HEADS, HOP, KERNEL, SMALLEST_POWER, WIDTH, WINDOW, network_weights


class FeedForward(nn.Module):
    """Norm, four times as wide, silu, back."""

    def __init__(self) -> None:
        super().__init__()
        self.norm, self.wide, self.back = nn.LayerNorm(WIDTH), nn.Linear(WIDTH, 4 * WIDTH), nn.Linear(4 * WIDTH, WIDTH)

    def forward(self, x: Tensor) -> Tensor:
        """[B, T, W]"""
        change: Tensor = self.back(functional.silu(self.wide(self.norm(x))))
        return change


class Attention(nn.Module):
    """Every frame looks at all frames, with HEADS heads."""

    def __init__(self) -> None:
        super().__init__()
        self.norm, self.heads, self.out = nn.LayerNorm(WIDTH), nn.Linear(WIDTH, 3 * WIDTH), nn.Linear(WIDTH, WIDTH)

    def forward(self, x: Tensor) -> Tensor:
        """[B, T, W]"""
        batch, count, _ = x.shape
        split = self.heads(self.norm(x)).reshape(batch, count, 3, HEADS, WIDTH // HEADS)
        q, k, v = split.permute(2, 0, 3, 1, 4)  # each [B, heads, T, W / heads]
        seen = functional.scaled_dot_product_attention(q, k, v)
        change: Tensor = self.out(seen.transpose(1, 2).reshape(batch, count, WIDTH))
        return change


class Convolution(nn.Module):
    """Norm, a gate, a convolution of each channel along time, silu, a mixing of channels."""

    def __init__(self) -> None:
        super().__init__()
        self.norm, self.gate, self.out = nn.LayerNorm(WIDTH), nn.Linear(WIDTH, 2 * WIDTH), nn.Linear(WIDTH, WIDTH)
        self.along_time = nn.Conv1d(WIDTH, WIDTH, KERNEL, padding="same", groups=WIDTH)

    def forward(self, x: Tensor) -> Tensor:
        """[B, T, W]"""
        gated = functional.glu(self.gate(self.norm(x)), dim=-1)
        change: Tensor = self.out(functional.silu(self.along_time(gated.transpose(1, 2)).transpose(1, 2)))
        return change


class Block(nn.Module):
    """A Conformer block (Gulati et al. 2020, eq. 1): half a feed-forward, attention, convolution, half a feed-forward, norm."""

    def __init__(self) -> None:
        super().__init__()
        self.first, self.attention, self.convolution, self.last = FeedForward(), Attention(), Convolution(), FeedForward()
        self.norm = nn.LayerNorm(WIDTH)

    def forward(self, x: Tensor) -> Tensor:
        """[B, T, W]"""
        x = x + self.first(x) / 2
        x = x + self.attention(x)
        x = x + self.convolution(x)
        normed: Tensor = self.norm(x + self.last(x) / 2)
        return normed


class PhoneNetwork(nn.Module):
    """Four Conformer blocks over 80 log-mel bands, a frame of 20 ms at the end, trained for CTC.

    Parameters
    ----------
    archive : PhoneArchive
        The weights; `phone_network()` gives the one that is installed.
    """

    spectrum: Tensor
    """[WINDOW, 402] windowed cosines and sines."""
    filters: Tensor
    """[201, BANDS]"""

    def __init__(self, archive: PhoneArchive) -> None:
        super().__init__()
        self.tokens = archive.tokens
        self.stem = nn.Conv1d(BANDS, WIDTH, 3, stride=2, padding=1)
        self.blocks = nn.ModuleList(Block() for _ in range(BLOCKS))
        self.head = nn.Linear(WIDTH, len(archive.tokens))
        self.register_buffer("spectrum", torch.zeros(WINDOW, WINDOW + 2))
        self.register_buffer("filters", torch.zeros(WINDOW // 2 + 1, BANDS))
        self.load_state_dict({name: torch.from_numpy(array) for name, array in network_weights(archive).items()})
        self.requires_grad_(False).eval()

    def forward(self, audio: Tensor) -> tuple[Tensor, Tensor]:
        """Audio [B, S] at 16 kHz to log-probabilities [B, T, tokens] and the blocks' outputs [B, T, BLOCKS, WIDTH].

        T is 1 + S // STEP; S is more than WINDOW / 2.
        """
        x = functional.gelu(self.stem(self.bands(audio).transpose(1, 2))).transpose(1, 2)
        hidden = []
        for block in self.blocks:
            x = block(x)
            hidden.append(x)
        return functional.log_softmax(self.head(x), dim=-1), torch.stack(hidden, dim=2)

    def bands(self, audio: Tensor) -> Tensor:
        """[B, 1 + S // HOP, BANDS] logarithm of the energy; beyond its ends the sound is mirrored."""
        frames = functional.pad(audio, (WINDOW // 2, WINDOW // 2), mode="reflect").unfold(1, WINDOW, HOP)
        real, imaginary = (frames @ self.spectrum).square().chunk(2, dim=2)
        return ((real + imaginary) @ self.filters).clamp(min=SMALLEST_POWER).log()

    @torch.no_grad()
    def part(self, *, audio: NDArray[Any]) -> list[NDArray[Any]]:
        """Called as an exported graph is: audio [B, S] to [log-probabilities, hidden]."""
        return [found.cpu().numpy() for found in self(torch.from_numpy(audio).to(self.spectrum.device))]


@cache
def phone_network() -> PhoneNetwork:
    """The network with the installed weights, read once; FacesynthError where they are missing or changed."""
    return PhoneNetwork(read_archive())
