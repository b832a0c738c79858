"""The noise that drives the stochastic part: independent sources, each with its histogram."""

from collections.abc import Sequence
from typing import Self

import numpy as np
import torch
from torch import Tensor, nn

from facesynth.inference.errors import FacesynthError
from facesynth.methods.lds.system import Array, Stochastic
from facesynth.motion.ica import Ica


class Innovations(nn.Module):
    """`e = D v` with independent v_i, each drawn from its histogram (Saisan 2004, eq. 4 and 10)."""

    mixing: Tensor
    """[p, p] D, the sources of unit variance."""
    edges: Tensor
    """[p, bins + 1] edges of each source's histogram."""
    cumulative: Tensor
    """[p, bins + 1] share of samples below each edge, 0 to 1."""
    kurtosis: Tensor
    """[p] excess kurtosis of each source: 0 for a Gaussian, 3 for a Laplacian."""

    def __init__(self, mixing: Tensor, edges: Tensor, cumulative: Tensor, kurtosis: Tensor, *, independent: bool = True) -> None:
        super().__init__()
        self.register_buffer("mixing", mixing)
        self.register_buffer("edges", edges)
        self.register_buffer("cumulative", cumulative)
        self.register_buffer("kurtosis", kurtosis)
        self.independent = independent

    @classmethod
    def empty(cls) -> Self:
        """One without content, for `load` to fill."""
        return cls(*(torch.zeros(0) for _ in range(4)))

    @classmethod
    def fit(cls, e: Array, *, seed: int = 0) -> Self:
        """Learn D and the histograms from innovations [N, p].

        Where independent components do not settle, because the innovations are as good as Gaussian, uncorrelated ones
        stand in (D is then the symmetric root of the covariance) and `independent` is False.
        """
        try:
            mixing, independent = Ica.fit(e, seed=seed).mixing.double().numpy(), True
        except FacesynthError:
            mixing, independent = _symmetric_root(e), False
        v = np.linalg.solve(mixing, e.T).T
        bins = int(np.clip(np.sqrt(len(v)), 8, 128))
        edges = np.stack([np.histogram_bin_edges(column, bins) for column in v.T])
        counts = np.stack([np.histogram(column, edge)[0] for column, edge in zip(v.T, edges, strict=True)])
        cumulative = np.concatenate([np.zeros((len(counts), 1)), counts.cumsum(axis=1) / len(v)], axis=1)
        # White noise has no mean; a slow system would turn the little that bins and burn-in leave of one into a lasting pose.
        edges -= (np.diff(cumulative, axis=1) * (edges[:, 1:] + edges[:, :-1]) / 2).sum(axis=1, keepdims=True)
        kurtosis = ((v - v.mean(axis=0)) ** 4).mean(axis=0) / v.var(axis=0) ** 2 - 3
        arrays = (mixing, edges, cumulative, kurtosis)
        return cls(*(torch.from_numpy(array.astype(np.float32)) for array in arrays), independent=independent)

    def forward(self, uniform: Tensor) -> Tensor:
        """Numbers [..., T, p] drawn evenly from 0..1 to innovations e: each source by the inverse of its cumulative histogram."""
        drawn = uniform.reshape(-1, len(self.mixing)).T.contiguous()  # [p, N]
        step = torch.searchsorted(self.cumulative, drawn, right=True).clamp(1, self.cumulative.shape[1] - 1)
        below, rise = self.cumulative.gather(1, step - 1), self.cumulative.diff(dim=1).gather(1, step - 1)
        left, width = self.edges.gather(1, step - 1), self.edges.diff(dim=1).gather(1, step - 1)
        v = left + (drawn - below) / rise.clamp(min=torch.finfo(drawn.dtype).tiny) * width
        return v.T.reshape(uniform.shape) @ self.mixing.T


def innovations_of(signals: Sequence[Array], noise: Stochastic, burn_in: int) -> Array:
    """One-step prediction errors [N, p] of all clips, without the first `burn_in` frames of each."""
    return np.concatenate([noise.innovations(y[:, :, None])[0][burn_in:, :, 0] for y in signals])


def _symmetric_root(e: Array) -> Array:
    values, vectors = np.linalg.eigh(np.cov(e, rowvar=False).reshape(e.shape[1], -1))
    return (vectors * np.sqrt(np.maximum(values, 1e-12 * values.max()))) @ vectors.T
