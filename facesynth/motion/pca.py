"""Principal components of motion frames."""

from typing import Any, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from facesynth.inference.errors import FacesynthError


class Pca(nn.Module):
    """`x = mean + z @ basis.T` with an orthonormal basis, so that distances survive up to the variance dropped."""

    mean: Tensor
    """[C] mean frame."""
    basis: Tensor
    """[C, D] principal directions, by falling variance."""
    variance_ratio: Tensor
    """[D] share of the variance that each direction holds."""

    def __init__(self, mean: Tensor, basis: Tensor, variance_ratio: Tensor) -> None:
        super().__init__()
        self.register_buffer("mean", mean)
        self.register_buffer("basis", basis)
        self.register_buffer("variance_ratio", variance_ratio)

    @classmethod
    def fit(cls, frames: NDArray[Any], components: float) -> Self:
        """Learn from frames [N, C] without NaN.

        `components` of 1 or more is a count; below 1 it is the share of the variance to explain.
        The sign of each direction makes its largest entry positive, so that fits repeat.
        """
        frames = np.asarray(frames, np.float64)
        if frames.ndim != 2 or len(frames) < 2 or not np.isfinite(frames).all():
            raise FacesynthError(
                f"PCA needs at least 2 complete frames [N, C]; got shape {frames.shape} (NaN and gaps left out?)"
            )
        mean = frames.mean(axis=0)
        covariance = np.cov(frames - mean, rowvar=False).reshape(frames.shape[1], -1)
        variance, directions = np.linalg.eigh(covariance)
        variance, directions = np.clip(variance[::-1], 0, None), directions[:, ::-1]
        ratio = variance / max(variance.sum(), np.finfo(float).tiny)
        count = min(_count(ratio, components), frames.shape[1], len(frames) - 1)
        directions = directions[:, :count]
        directions = directions * np.sign(directions[np.abs(directions).argmax(axis=0), np.arange(count)])
        return cls(*(torch.from_numpy(np.ascontiguousarray(a, np.float32)) for a in (mean, directions, ratio[:count])))

    def encode(self, frames: Tensor) -> Tensor:
        """Frames [..., C] to coordinates [..., D]."""
        return (frames - self.mean) @ self.basis

    def decode(self, coordinates: Tensor) -> Tensor:
        """Coordinates [..., D] to frames [..., C]."""
        return coordinates @ self.basis.T + self.mean

    def forward(self, frames: Tensor) -> Tensor:
        """The same as `encode`."""
        return self.encode(frames)


def _count(variance_ratio: NDArray[np.float64], components: float) -> int:
    if components <= 0:
        raise FacesynthError(f"components must be a count or a share of variance in (0, 1); got {components}")
    if components >= 1:
        return int(components)
    return int(np.searchsorted(np.cumsum(variance_ratio), components) + 1)
