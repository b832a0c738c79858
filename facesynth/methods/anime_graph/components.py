"""Independent components of a face: what the graph, the emotion maps and the low-pass filter work on."""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.motion.ica import Ica
from facesynth.motion.pca import Pca

UPPER_GROUPS = ("brows", "eyelids", "upper_face", "forehead", "rigid")
"""Layout groups that move with the upper face; everything else moves with the lips and the jaw."""
BLOCKS = ("lips", "upper face")
MOST_FRAMES = 60_000
"""Of more frames than this, evenly spaced ones are enough to find the components."""


class FaceComponents(nn.Module):
    """`x = mean + u @ mixing.T`, lips and upper face separated, head motion removed beforehand.

    Cao 2005 organises the markers in rigid head, upper face and lips (§3.2) and takes PCA, then ICA, of the
    motion (§4.1). Here each of the two groups has components of its own, so that no component of speech can
    move the brows.
    """

    mean: Tensor
    """[C] float64."""
    mixing: Tensor
    """[C, D] float64: what each component does; lips first, in each block by falling energy."""
    analysis: Tensor
    """[D, C] float64: `analysis @ mixing` is the identity."""
    metric: Tensor
    """[D, D] float64: squared distance of two frames, averaged over channels, is `‖(u - v) @ metric‖²`."""
    block: Tensor
    """[D] 0 for lips, 1 for the upper face."""
    captured_share: Tensor
    """[] share of the training motion's variance that the components hold."""

    def fit(self, frames: NDArray[Any], layout: Layout, *, variance: float, seed: int) -> "FaceComponents":
        """Learn from complete frames [N, C]; `variance` is the share that PCA keeps in each block."""
        frames = frames[:: max(1, len(frames) // MOST_FRAMES)]
        mean = np.asarray(frames, np.float64).mean(axis=0)
        parts = [(number, columns) for number, columns in enumerate(block_columns(layout)) if _moves(frames, columns)]
        if not parts:
            raise FacesynthError("nothing moves in this corpus: there is no motion to learn from")
        mixings = [_block_mixing(frames[:, columns], variance, seed) for _, columns in parts]
        mixing = np.zeros((layout.channels, sum(m.shape[1] for m in mixings)))
        at = 0
        for (_, columns), part in zip(parts, mixings, strict=True):
            mixing[columns, at : at + part.shape[1]] = part
            at += part.shape[1]
        blocks = np.concatenate([np.full(m.shape[1], number) for (number, _), m in zip(parts, mixings, strict=True)])
        self.keep(mean, mixing, blocks)
        residual = frames - self.decode_array(self.encode_array(frames))
        share = 1.0 - np.square(residual).sum() / np.square(frames - mean).sum()
        self.register_buffer("captured_share", torch.tensor(share, dtype=torch.float64))
        return self

    def keep(self, mean: NDArray[np.float64], mixing: NDArray[np.float64], blocks: NDArray[np.int64]) -> None:
        """Take components as they are: mean [C], mixing [C, D], and the block of each [D]."""
        orthonormal, triangle = np.linalg.qr(mixing)
        analysis = np.linalg.solve(triangle, orthonormal.T)
        arrays = {"mean": mean, "mixing": mixing, "analysis": analysis, "metric": triangle.T / np.sqrt(len(mean))}
        for name, array in arrays.items():
            self.register_buffer(name, torch.from_numpy(np.ascontiguousarray(array)))
        self.register_buffer("block", torch.from_numpy(blocks))

    @property
    def count(self) -> int:
        """D, the number of components."""
        return int(self.mixing.shape[1])

    def encode(self, frames: Tensor) -> Tensor:
        """Frames [..., C] to components [..., D], float64."""
        return (frames.to(torch.float64) - self.mean) @ self.analysis.T

    def decode(self, components: Tensor) -> Tensor:
        """Components [..., D] to frames [..., C], float64."""
        return components.to(torch.float64) @ self.mixing.T + self.mean

    def forward(self, frames: Tensor) -> Tensor:
        """The same as `encode`."""
        return self.encode(frames)

    def encode_array(self, frames: NDArray[Any]) -> NDArray[np.float64]:
        """The same as `encode`, for arrays."""
        return self.encode(torch.from_numpy(np.asarray(frames, np.float64)).to(self.mean.device)).cpu().numpy()

    def decode_array(self, components: NDArray[np.float64]) -> NDArray[np.float64]:
        """The same as `decode`, for arrays."""
        return self.decode(torch.from_numpy(components).to(self.mean.device)).cpu().numpy()


def block_columns(layout: Layout) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Channels of the lips and of the upper face."""
    upper = np.unique(np.concatenate([np.zeros(0, np.int64), *(layout.columns(g) for g in UPPER_GROUPS if g in layout.groups)]))
    return np.setdiff1d(np.arange(layout.channels), upper), upper


def _moves(frames: NDArray[Any], columns: NDArray[np.int64]) -> bool:
    return bool(len(columns)) and float(np.ptp(frames[:, columns], axis=0).max()) > 0


def _block_mixing(frames: NDArray[Any], variance: float, seed: int) -> NDArray[np.float64]:
    """[C, D] PCA to a share of the variance, then ICA of its coordinates."""
    pca = Pca.fit(frames, variance)
    coordinates = pca.encode(torch.from_numpy(np.asarray(frames, np.float32))).numpy()
    ica = Ica.fit(coordinates, seed=seed)
    return pca.basis.numpy().astype(np.float64) @ ica.mixing.numpy().astype(np.float64)
