"""The system's input learned from log-mel bands, from the phone network's layer, or from both, in place of the periodogram.

As `learned_input`, with other features: their principal components at times around a frame are mapped to the shape by ridge
regression, and each recording's input is that of weights which were learned from others.
"""

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor, nn

from facesynth.inference.expectation import BANDS_FPS, linear_at
from facesynth.inference.heard_input import ARRAYS, SIDE_S, HeardInput
from facesynth.methods.lds.learned_input import apart, folds_of, weights_of
from facesynth.methods.lds.recordings import Piece, require_change
from facesynth.methods.lds.system import Array
from facesynth.methods.learn.hearing import Features, Hearing
from facesynth.motion.pca import Pca

TIMES = 11
"""Around a frame, 40 ms apart."""
NARROW, LOOKED_AT = 80, 4
"""Principal components of the features, learned from every so many-th frame of them."""


class HeardRegression(nn.Module):
    """What is heard, and the regression from it to the system's input."""

    weights: Tensor
    """[TIMES, W, m], see `HeardInput`."""
    bias: Tensor
    """[m]"""
    low: Tensor
    """[m]"""
    high: Tensor
    """[m]"""

    def __init__(self, features: Features) -> None:
        super().__init__()
        self.hearing = Hearing(features)
        for name in ARRAYS:
            self.register_buffer(name, torch.zeros(0))

    def learn(self, pieces: Sequence[Piece], shapes: Sequence[Array], fps: float) -> list[Array]:
        """The input [T, m] of each piece, whose shapes [T, m] are given, of deviation 1 over all."""
        self.hearing.begin()
        heard = [self.hearing.of_sound(np.ascontiguousarray(piece.audio)) for piece in pieces]
        require_change(np.concatenate(heard), "the sound")
        self.hearing.standardise(heard)
        standard = self.hearing.standard()
        seen = [(one[::LOOKED_AT] - standard.mean) / standard.deviation for one in heard]
        pca = Pca.fit(np.concatenate(seen), min(NARROW, self.hearing.width))
        basis = pca.basis.numpy() / standard.deviation[:, None]  # from features to components
        centre = (standard.mean @ basis) + pca.mean.numpy() @ pca.basis.numpy()
        x = [_around(one @ basis - centre, piece, fps) for one, piece in zip(heard, pieces, strict=True)]
        parts = folds_of(pieces)
        weights, others = weights_of(x, shapes, parts)
        inputs = [apart(one, part, others) for one, part in zip(x, parts, strict=True)]
        stacked = np.concatenate(inputs)
        scale = np.maximum(stacked.std(axis=0), 1e-6 * stacked.std(axis=0).max())
        each = (weights / scale).reshape(TIMES, -1, weights.shape[1])
        bounds = stacked.min(axis=0) / scale, stacked.max(axis=0) / scale
        for name, array in zip(ARRAYS, (basis @ each, -np.einsum("w,nwm->m", centre, each), *bounds), strict=True):
            setattr(self, name, torch.from_numpy(np.ascontiguousarray(array, np.float32)))
        return [one / scale for one in inputs]

    def input(self, fps: float) -> HeardInput:
        """What a system at `fps` is driven by."""
        return HeardInput(self.hearing.listening(), fps, *(getattr(self, name).cpu().numpy() for name in ARRAYS))


def _around(components: Array, piece: Piece, fps: float) -> Array:
    """[T, N k] components [F, k] of a piece's sound at N times around each of its frames."""
    times_s = np.arange(piece.first, piece.stop)[:, None] / fps + np.linspace(-SIDE_S, SIDE_S, TIMES)
    return linear_at(components, np.clip(times_s * BANDS_FPS, 0, len(components) - 1)).reshape(len(times_s), -1)
