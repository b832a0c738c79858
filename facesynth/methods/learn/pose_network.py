"""The network of poses: causal convolutions over what is heard and said, whose input runs ahead by what may be looked ahead."""

import torch
from torch import Tensor, nn
from torch.nn import functional

KERNEL = 3
DILATIONS = (1, 2, 4, 1, 2, 4, 1, 2)
"""Of the residual blocks."""
REACH = KERNEL - 1 + (KERNEL - 1) * sum(DILATIONS)
"""Frames that an output depends on beside its own, all of them before it."""
SYMMETRIC = REACH // 2
"""Frames by which the input runs ahead where the whole utterance is known: as many after a frame as before it."""


class CausalBlock(nn.Module):
    """`x + conv1(gelu(conv3(norm(x))))`: the norm is each frame's own, so that a stream gives what the whole gives."""

    def __init__(self, width: int, dilation: int, dropout: float) -> None:
        super().__init__()
        self.norm = nn.LayerNorm(width)
        self.spread = nn.Conv1d(width, width, KERNEL, dilation=dilation)
        self.mix = nn.Conv1d(width, width, 1)
        self.dropout = nn.Dropout(dropout)

    def forward(self, x: Tensor) -> Tensor:
        """[B, width, F] to the same."""
        normed = self.norm(x.transpose(1, 2)).transpose(1, 2)
        spread = self.spread(functional.pad(normed, (2 * self.spread.dilation[0], 0)))
        added: Tensor = self.dropout(self.mix(functional.gelu(spread)))
        return x + added


class PoseNetwork(nn.Module):
    """[B, F, inputs] to components [B, F, outputs] and the logarithms of their deviations; frame f sees frames up to f.

    The deviations are read off the same layers and send nothing back through them: whoever leaves them out loses nothing.
    """

    columns: Tensor
    """[inputs] of what is told, those that are read; none for all."""

    def __init__(
        self, inputs: int, outputs: int, *, width: int = 128, dropout: float = 0.2, seed: int = 0, columns: Tensor | None = None
    ) -> None:
        """seed: of the first weights; torch's own generator stays as it was."""
        super().__init__()
        self.register_buffer("columns", torch.zeros(0, dtype=torch.int64) if columns is None else columns)
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self.dropout = nn.Dropout(dropout)
            self.first = nn.Conv1d(inputs, width, KERNEL)
            self.blocks = nn.Sequential(*(CausalBlock(width, dilation, dropout) for dilation in DILATIONS))
            self.poses = nn.Conv1d(width, outputs, 1)
            self.log_deviations = nn.Conv1d(width, outputs, 1)

    def forward(self, told: Tensor) -> tuple[Tensor, Tensor]:
        """Components and logarithms of deviations, both [B, F, outputs]."""
        read = told[..., self.columns] if len(self.columns) else told
        heard = functional.pad(self.dropout(read).transpose(1, 2), (KERNEL - 1, 0))
        deep = self.dropout(self.blocks(functional.gelu(self.first(heard))))
        return self.poses(deep).transpose(1, 2), self.log_deviations(deep.detach()).transpose(1, 2)


def frames_ahead(look_ahead_s: float | None, rate: float) -> int:
    """Frames by which the input runs ahead; None: as many as the network reads back."""
    return SYMMETRIC if look_ahead_s is None else min(SYMMETRIC, round(look_ahead_s * rate))
