"""Independent components of motion, in an order and with signs that repeat."""

import warnings
from typing import Any, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from facesynth.inference.errors import FacesynthError

MOST_FRAMES = 60_000
"""Neighbouring frames repeat each other: of more frames than this, evenly spaced ones are learned from."""


class Ica(nn.Module):
    """`x = mean + u @ mixing.T` with independent sources u of unit variance (Cao 2005, eq. 7)."""

    mean: Tensor
    """[D] mean of the mixtures."""
    mixing: Tensor
    """[D, D] the matrix A: column i is what source i does; columns by falling energy, largest entry positive."""
    unmixing: Tensor
    """[D, D] inverse of `mixing`."""

    def __init__(self, mean: Tensor, mixing: Tensor, unmixing: Tensor) -> None:
        super().__init__()
        self.register_buffer("mean", mean)
        self.register_buffer("mixing", mixing)
        self.register_buffer("unmixing", unmixing)

    @classmethod
    def fit(cls, mixtures: NDArray[Any], *, seed: int = 0, iterations: int = 500) -> Self:
        """Learn from frames [N, D], as many sources as mixtures, by FastICA.

        The simultaneous form is tried first, then one source at a time; FacesynthError where neither settles.
        """
        mixtures = np.asarray(mixtures, np.float64)
        if mixtures.ndim != 2 or len(mixtures) <= mixtures.shape[1] or not np.isfinite(mixtures).all():
            raise FacesynthError(
                f"ICA needs complete frames [N, D], more frames than channels; got shape {mixtures.shape} (are gaps left out?)"
            )
        if (np.ptp(mixtures, axis=0) <= 1e-12).any():
            raise FacesynthError("ICA cannot separate channels that never move; keep fewer principal components")
        mean = mixtures.mean(axis=0)
        mixing = _in_order(_fast_ica(mixtures - mean, seed, iterations))
        arrays = (mean, mixing, np.linalg.inv(mixing))
        return cls(*(torch.from_numpy(np.ascontiguousarray(a, np.float32)) for a in arrays))

    def encode(self, mixtures: Tensor) -> Tensor:
        """Mixtures [..., D] to sources [..., D]."""
        return (mixtures - self.mean) @ self.unmixing.T

    def decode(self, sources: Tensor) -> Tensor:
        """Sources [..., D] to mixtures [..., D]."""
        return sources @ self.mixing.T + self.mean

    def forward(self, mixtures: Tensor) -> Tensor:
        """The same as `encode`."""
        return self.encode(mixtures)


def _fast_ica(centred: NDArray[np.float64], seed: int, iterations: int) -> NDArray[np.float64]:
    if centred.shape[1] == 1:
        return np.array([[centred.std()]])
    from sklearn.decomposition import FastICA
    from sklearn.exceptions import ConvergenceWarning

    some = centred[:: max(1, len(centred) // MOST_FRAMES)]
    for algorithm in ("parallel", "deflation"):
        learner = FastICA(algorithm=algorithm, whiten="unit-variance", max_iter=iterations, tol=1e-4, random_state=seed)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)  # only one of the two forms warns: both are counted
            learner.fit(some)
        if learner.n_iter_ < iterations:
            return learner.mixing_
    raise FacesynthError(
        f"ICA did not converge in {iterations} steps on {len(some)} frames of {centred.shape[1]} components; "
        "keep fewer components (a smaller share of the variance) or record more motion"
    )


def _in_order(mixing: NDArray[np.float64]) -> NDArray[np.float64]:
    by_energy = np.argsort(-np.square(mixing).sum(axis=0), kind="stable")
    mixing = mixing[:, by_energy]
    largest = mixing[np.abs(mixing).argmax(axis=0), np.arange(mixing.shape[1])]
    return mixing * np.sign(largest)
