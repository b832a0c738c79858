"""Support vector machines, fitted by scikit-learn, as pairwise classifiers (Cao 2005, §6)."""

from dataclasses import dataclass
from itertools import combinations
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.errors import unknown
from facesynth.methods.emotion.pairwise import DEGREE, Kernel, Pairs, PairwiseClassifier, require_classes

KERNELS: dict[str, str] = {"linear": "linear", "polynomial": "poly", "radial": "rbf"}


@dataclass(frozen=True)
class SvmSettings:
    """libsvm's two formulations and three kernels; gamma is 1 / features, libsvm's default."""

    kernel: Kernel = "linear"
    formulation: Literal["C", "nu"] = "C"
    cost: float = 1.0
    """C of the C formulation."""
    nu: float = 0.5
    """Of the nu formulation: between margin errors and support vectors. More than the classes allow is lowered."""


def fit_svm(
    x: NDArray[np.float64], y: NDArray[np.int64], settings: SvmSettings, groups: NDArray[Any] | None = None
) -> PairwiseClassifier:
    """Learn from scaled features x [N, F] and classes y [N] 0..K-1, all of which occur; `groups` as in `PairwiseClassifier`."""
    if settings.kernel not in KERNELS:
        raise unknown("kernel", settings.kernel, KERNELS)
    require_classes(y)

    def learner(some: NDArray[np.float64], classes: NDArray[np.int64]) -> Pairs:
        return _pairs(_machine(settings, classes).fit(some, classes), settings.kernel)

    return PairwiseClassifier.fit(x, y, learner, settings.kernel, groups)


def _machine(settings: SvmSettings, y: NDArray[np.int64]) -> Any:
    from sklearn.svm import SVC, NuSVC

    shared = {"kernel": KERNELS[settings.kernel], "gamma": "auto", "degree": DEGREE, "decision_function_shape": "ovo"}
    if settings.formulation == "C":
        return SVC(C=settings.cost, **shared)
    counts = np.bincount(y)
    feasible = min(2 * min(a, b) / (a + b) for a, b in combinations(counts, 2))
    return NuSVC(nu=min(settings.nu, 0.99 * feasible), **shared)


def _pairs(learner: Any, kernel: Kernel) -> Pairs:
    """Support vectors, weights and offsets of a fitted SVC.

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
    vectors, weights, offsets = learner.support_vectors_, sign * weights, sign * learner.intercept_
    return Pairs(vectors[:0], weights @ vectors, offsets) if kernel == "linear" else Pairs(vectors, weights, offsets)
