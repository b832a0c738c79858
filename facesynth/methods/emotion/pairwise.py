"""Classifiers of many classes by a decision for each pair of them, with calibrated probabilities, run by torch."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Literal, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from facesynth.inference.errors import FacesynthError
from facesynth.methods.emotion.probabilities import couple, fit_sigmoid, vote

Kernel = Literal["linear", "polynomial", "radial"]
FOLDS = 5
"""Margins for Platt's sigmoids come from classifiers that did not see the sample."""
DEGREE = 3
"""libsvm's default degree of the polynomial kernel."""


@dataclass(frozen=True, eq=False)
class Pairs:
    """What a margin of each pair of classes is computed from."""

    vectors: NDArray[np.float64]
    """[V, F] support vectors; none for the linear kernel."""
    weights: NDArray[np.float64]
    """[pairs, V], for the linear kernel [pairs, F]."""
    offsets: NDArray[np.float64]
    """[pairs]"""


Learner = Callable[[NDArray[np.float64], NDArray[np.int64]], Pairs]
"""From scaled features [N, F] and classes [N] 0..K-1, all of which occur, to pairs of a known kernel."""


class PairwiseClassifier(nn.Module):
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
    def fit(
        cls,
        x: NDArray[np.float64],
        y: NDArray[np.int64],
        learner: Learner,
        kernel: Kernel,
        groups: NDArray[Any] | None = None,
    ) -> Self:
        """Learn from scaled features x [N, F] and classes y [N] 0..K-1, all of which occur.

        groups [N]: what must not be on both sides when margins are calibrated (speakers, sentences).
        """
        machine = cls(require_classes(y), kernel)
        machine._keep(learner(x, y), _sigmoids(x, y, learner, kernel, groups))
        return machine

    def _keep(self, pairs: Pairs, sigmoids: NDArray[np.float64]) -> None:
        arrays = {"vectors": pairs.vectors, "weights": pairs.weights, "offsets": pairs.offsets, "sigmoids": sigmoids}
        for name, array in arrays.items():
            self.register_buffer(name, torch.from_numpy(np.ascontiguousarray(array, np.float64)))

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


def require_classes(y: NDArray[np.int64]) -> int:
    """K of classes y [N] 0..K-1; FacesynthError where there are fewer than two, or one of them does not occur."""
    classes = int(y.max()) + 1
    missing = sorted(set(range(classes)) - set(y.tolist()))
    if classes < 2 or missing:
        raise FacesynthError(f"a classifier needs examples of at least two classes; got {sorted(set(y.tolist()))}")
    return classes


Indices = NDArray[np.int64]


def folds_of(y: NDArray[np.int64], groups: NDArray[Any] | None) -> list[tuple[Indices, Indices]]:
    """Samples to learn from and samples to test on, of at most FOLDS folds: by groups [N] where there are several, else by
    class; none where a class has one sample only.
    """
    from sklearn.model_selection import GroupKFold, StratifiedKFold

    everything = np.zeros(len(y))
    if groups is not None and len(set(groups.tolist())) > 1:
        return list(GroupKFold(min(FOLDS, len(set(groups.tolist())))).split(everything, y, groups))
    count = min(FOLDS, int(np.bincount(y).min()))
    return list(StratifiedKFold(count, shuffle=True, random_state=0).split(everything, y)) if count > 1 else []


def _sigmoids(
    x: NDArray[np.float64], y: NDArray[np.int64], learner: Learner, kernel: Kernel, groups: NDArray[Any] | None
) -> NDArray[np.float64]:
    """[pairs, 2] Platt's parameters from margins of held-out samples; where a pair was never held out, of all."""
    classes = int(y.max()) + 1
    margins = np.full((len(x), classes * (classes - 1) // 2), np.nan)
    for train, test in folds_of(y, groups):
        if len(set(y[train].tolist())) == classes:
            margins[test] = _margins(x[test], learner(x[train], y[train]), kernel)
    seen = np.isfinite(margins[:, 0])
    result = []
    for pair, (i, j) in enumerate(combinations(range(classes), 2)):
        among = seen & ((y == i) | (y == j))
        both = {i, j} <= set(y[among].tolist())
        result.append(fit_sigmoid(margins[among, pair], y[among] == i) if both else (-1.0, 0.0))
    return np.array(result)


def _margins(x: NDArray[np.float64], pairs: Pairs, kernel: Kernel) -> NDArray[np.float64]:
    machine = PairwiseClassifier(2, kernel)
    machine._keep(pairs, np.zeros((len(pairs.offsets), 2)))
    return machine.margins(torch.from_numpy(x)).numpy()
