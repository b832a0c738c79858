"""Running the system: any length at once, or frame by frame with the state handed on."""

from typing import Self

import numpy as np
import torch
from scipy.linalg import block_diag
from torch import Tensor, nn

from facesynth.methods.lds.system import Deterministic, Stochastic


class Rollout(nn.Module):
    """Both parts as one system: x' = A x + B [u; e], y = C x + D [u; e], x = [x_d; x_s], of which noise is shown by gains."""

    A: Tensor
    """[n, n] block diagonal."""
    B: Tensor
    """[n, m + p]"""
    C: Tensor
    """[p, n]"""
    D: Tensor
    """[p, m + p] = [D_d, I]"""
    gains: Tensor
    """[p] how much of its noise each component of the shape shows; 1 as identified."""
    noisy: Tensor
    """[n] 1 for the states that noise drives, 0 for those that the sound drives."""

    def __init__(self, A: Tensor, B: Tensor, C: Tensor, D: Tensor, gains: Tensor, noisy: Tensor) -> None:
        super().__init__()
        for name, matrix in (("A", A), ("B", B), ("C", C), ("D", D), ("gains", gains), ("noisy", noisy)):
            self.register_buffer(name, matrix)

    @classmethod
    def empty(cls) -> Self:
        """One without content, for `load` to fill."""
        empty, none = torch.zeros(0, 0), torch.zeros(0)
        return cls(empty, empty, empty, empty, none, none)

    @classmethod
    def of(cls, deterministic: Deterministic, stochastic: Stochastic) -> Self:
        """From what was identified."""
        A, B = block_diag(deterministic.A, stochastic.A), block_diag(deterministic.B, stochastic.B)
        C = np.hstack([deterministic.C, stochastic.C])
        D = np.hstack([deterministic.D, np.eye(len(C))])
        noisy = np.repeat([0.0, 1.0], [deterministic.order, stochastic.order])
        return cls(
            *(torch.from_numpy(np.ascontiguousarray(matrix, np.float32)) for matrix in (A, B, C, D, np.ones(len(C)), noisy))
        )

    @property
    def shown(self) -> tuple[Tensor, Tensor]:
        """C and D with the gains on what noise adds."""
        if not len(self.gains):  # a model from before there were gains
            return self.C, self.D
        less = self.gains[:, None] - 1
        of_noise = torch.cat([self.D.new_zeros(self.D.shape[1] - len(self.gains)), self.D.new_ones(len(self.gains))])
        return (self.C * (1 + less * self.noisy)).contiguous(), (self.D * (1 + less * of_noise)).contiguous()

    def rest(self) -> Tensor:
        """[n] the state of a face whose inputs have been average for long: zero."""
        return self.A.new_zeros(len(self.A))

    def forward(self, u: Tensor, e: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """Features [..., T, m], innovations [..., T, p], first state [..., n] to shapes [..., T, p] and the state after them.

        Feeding it the frames in pieces, the state handed on, gives what feeding them at once gives.
        """
        drive = torch.cat([u, e], dim=-1)
        onward, states = self.A.T, []
        for push in (drive @ self.B.T).unbind(-2):
            states.append(state)
            state = push + state @ onward
        C, D = self.shown
        return torch.stack(states, dim=-2) @ C.T + drive @ D.T, state
