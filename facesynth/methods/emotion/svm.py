"""A multi-class support vector machine: fitted by scikit-learn, run by torch."""

from dataclasses import dataclass
from itertools import combinations
from typing import Any, Literal, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from facesynth.inference.errors import FacesynthError, unknown
from facesynth.methods.emotion.probabilities import couple, fit_sigmoid, vote

Kernel = Literal["linear", "polynomial", "radial"]
KERNELS: dict[str, str] = {"linear": "linear", "polynomial": "poly", "radial": "rbf"}
FOLDS = 5
"""Margins for Platt's sigmoids come from classifiers that did not see the sample."""
DEGREE = 3
"""libsvm's default degree of the polynomial kernel."""


@dataclass(frozen=True)
class SvmSettings:
    """libsvm's two formulations and three kernels; gamma is 1 / features, libsvm's default."""

    kernel: Kernel = "linear"
    formulation: Literal["C", "nu"] = "C"
    cost: float = 1.0
    """C of the C formulation."""
    nu: float = 0.5
    """Of the nu formulation: between margin errors and support vectors. More than the classes allow is lowered."""


class Svm(nn.Module):
    """K(K-1)/2 pairwise classifiers with sigmoids, as one module.

    The *decision* is the class that wins most pairs, as in scikit-learn; the most probable class may differ.
    """

    vectors: Tensor
    """[V, F] support vectors; none for the linear kernel."""
    weights: Tensor
    """[pairs, V], for the linear kernel [pairs, F]."""
    offsets: Tensor
    """[pairs]"""
    sigmoids: Tensor
    """[pairs, 2] Platt's slope and offset."""

    def __init__(self, classes: int, kernel: Kernel) -> None:
        super().__init__()
        self.classes, self.kernel = classes, kernel

    @classmethod
    def fit(cls, x: NDArray[np.float64], y: NDArray[np.int64], settings: SvmSettings, groups: NDArray[Any] | None = None) -> Self:
        """Learn from scaled features x [N, F] and classes y [N] 0..K-1, all of which occur.

        groups [N]: what must not be on both sides when margins are calibrated (speakers, sentences).
        """
        if settings.kernel not in KERNELS:
            raise unknown("kernel", settings.kernel, KERNELS)
        classes = int(y.max()) + 1
        missing = sorted(set(range(classes)) - set(y.tolist()))
        if classes < 2 or missing:
            raise FacesynthError(f"a classifier needs examples of at least two classes; got {sorted(set(y.tolist()))}")
        machine = cls(classes, settings.kernel)
        vectors, weights, offsets = _pairwise(_learner(settings, y).fit(x, y))
        if settings.kernel == "linear":
            vectors, weights = vectors[:0], weights @ vectors
        sigmoids = _sigmoids(x, y, settings, groups)
        arrays = {"vectors": vectors, "weights": weights, "offsets": offsets, "sigmoids": sigmoids}
        for name, array in arrays.items():
            machine.register_buffer(name, torch.from_numpy(np.ascontiguousarray(array, np.float64)))
        return machine

    def margins(self, x: Tensor) -> Tensor:
        """Features [..., F] to margins [..., pairs]: positive where the first of a pair wins."""
        x = x.to(torch.float64)
        if self.kernel == "linear":
            return x @ self.weights.T + self.offsets
        gamma = 1.0 / x.shape[-1]
        if self.kernel == "polynomial":
            similar = (gamma * x @ self.vectors.T) ** DEGREE
        else:
            squared = x.square().sum(-1, keepdim=True) + self.vectors.square().sum(-1) - 2 * x @ self.vectors.T
            similar = torch.exp(-gamma * squared.clamp(min=0))
        return similar @ self.weights.T + self.offsets

    def decide(self, x: Tensor) -> Tensor:
        """Features [..., F] to the class [...] that wins most pairs."""
        return vote(self.margins(x), self.classes)

    def forward(self, x: Tensor) -> Tensor:
        """Features [..., F] to class probabilities [..., K]."""
        return self.probabilities(self.margins(x))

    def probabilities(self, margins: Tensor) -> Tensor:
        """Margins [..., pairs] to class probabilities [..., K]."""
        exponent = margins * self.sigmoids[:, 0] + self.sigmoids[:, 1]
        return couple(torch.sigmoid(-exponent), self.classes)


def _learner(settings: SvmSettings, y: NDArray[np.int64]) -> Any:
    from sklearn.svm import SVC, NuSVC

    shared = {"kernel": KERNELS[settings.kernel], "gamma": "auto", "degree": DEGREE, "decision_function_shape": "ovo"}
    if settings.formulation == "C":
        return SVC(C=settings.cost, **shared)
    counts = np.bincount(y)
    feasible = min(2 * min(a, b) / (a + b) for a, b in combinations(counts, 2))
    return NuSVC(nu=min(settings.nu, 0.99 * feasible), **shared)


def _pairwise(learner: Any) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Support vectors [V, F], weights [pairs, V] and offsets [pairs] of a fitted SVC.

    libsvm keeps, for a support vector of class i, one coefficient for each other class; row j - 1 (j after i) or j
    (j before i) is the one against class j. With two classes scikit-learn turns the sign.
    """
    classes = len(learner.classes_)
    sign = -1.0 if classes == 2 else 1.0
    owner = np.repeat(np.arange(classes), learner.n_support_)
    weights = np.zeros((classes * (classes - 1) // 2, len(owner)))
    for pair, (i, j) in enumerate(combinations(range(classes), 2)):
        weights[pair, owner == i] = learner.dual_coef_[j - 1, owner == i]
        weights[pair, owner == j] = learner.dual_coef_[i, owner == j]
    return learner.support_vectors_, sign * weights, sign * learner.intercept_


def _sigmoids(
    x: NDArray[np.float64], y: NDArray[np.int64], settings: SvmSettings, groups: NDArray[Any] | None
) -> NDArray[np.float64]:
    """[pairs, 2] Platt's parameters from margins of held-out samples; where a pair was never held out, of all."""
    classes = int(y.max()) + 1
    margins = np.full((len(x), classes * (classes - 1) // 2), np.nan)
    for train, test in _folds(x, y, groups):
        if len(set(y[train].tolist())) == classes:
            vectors, weights, offsets = _pairwise(_learner(settings, y[train]).fit(x[train], y[train]))
            margins[test] = _margins(x[test], vectors, weights, offsets, settings.kernel)
    seen = np.isfinite(margins[:, 0])
    result = []
    for pair, (i, j) in enumerate(combinations(range(classes), 2)):
        among = seen & ((y == i) | (y == j))
        both = {i, j} <= set(y[among].tolist())
        result.append(fit_sigmoid(margins[among, pair], y[among] == i) if both else (-1.0, 0.0))
    return np.array(result)


def _margins(
    x: NDArray[np.float64],
    vectors: NDArray[np.float64],
    weights: NDArray[np.float64],
    offsets: NDArray[np.float64],
    kernel: Kernel,
) -> NDArray[np.float64]:
    machine = Svm(2, kernel)
    machine.vectors, machine.offsets = torch.from_numpy(vectors), torch.from_numpy(offsets)
    machine.weights = torch.from_numpy(weights @ vectors if kernel == "linear" else weights)
    return machine.margins(torch.from_numpy(x)).numpy()


def _folds(x: NDArray[np.float64], y: NDArray[np.int64], groups: NDArray[Any] | None) -> list[tuple[NDArray, NDArray]]:
    from sklearn.model_selection import GroupKFold, StratifiedKFold

    if groups is not None and len(set(groups.tolist())) > 1:
        return list(GroupKFold(min(FOLDS, len(set(groups.tolist())))).split(x, y, groups))
    count = min(FOLDS, int(np.bincount(y).min()))
    return list(StratifiedKFold(count, shuffle=True, random_state=0).split(x, y)) if count > 1 else []
