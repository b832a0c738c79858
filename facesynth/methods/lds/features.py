"""The input of the system: principal components of the periodogram, in units of their standard deviation."""

from collections.abc import Sequence
from typing import Any, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from facesynth.inference.errors import FacesynthError
from facesynth.motion.pca import Pca


class Standardised(nn.Module):
    """Principal components, each divided by its standard deviation and held to the range it was seen in."""

    scale: Tensor
    """[D] standard deviation of each component."""
    low: Tensor
    """[D] least value seen, in standard deviations."""
    high: Tensor
    """[D] largest value seen."""

    def __init__(self, pca: Pca, scale: Tensor, low: Tensor, high: Tensor) -> None:
        super().__init__()
        self.pca = pca
        self.register_buffer("scale", scale)
        self.register_buffer("low", low)
        self.register_buffer("high", high)

    @classmethod
    def empty(cls) -> Self:
        """One without content, for `load` to fill."""
        nothing = torch.zeros(0)
        return cls(Pca(nothing, nothing, nothing), nothing, nothing, nothing)

    @classmethod
    def fit(cls, frames: Sequence[NDArray[Any]], components: float, what: str) -> Self:
        """Learn from clips of frames [T, C]; FacesynthError where they are constant."""
        stacked = np.concatenate(frames)
        if np.ptp(stacked, axis=0).max() <= 1e-9 * max(1.0, float(np.abs(stacked).max())):
            raise FacesynthError(
                f"{what} is the same in all {len(stacked)} frames: there is nothing to learn; check the recording"
            )
        pca = Pca.fit(stacked, components)
        encoded = pca.encode(torch.from_numpy(stacked).float())
        moving = encoded.std(dim=0) > 1e-6 * encoded.std(dim=0).max()
        pca = Pca(pca.mean, pca.basis[:, moving], pca.variance_ratio[moving])
        encoded = encoded[:, moving]
        scale = encoded.std(dim=0)
        return cls(pca, scale, encoded.amin(dim=0) / scale, encoded.amax(dim=0) / scale)

    def encode(self, frames: Tensor) -> Tensor:
        """Frames [T, C] to components [T, D] of about unit variance.

        Held to the range seen in training: a linear system would follow sound that it never heard, such as digital
        silence, anywhere.
        """
        return torch.clamp(self.pca.encode(frames) / self.scale, self.low, self.high)

    def decode(self, components: Tensor) -> Tensor:
        """Components [T, D] to frames [T, C]."""
        return self.pca.decode(components * self.scale)
