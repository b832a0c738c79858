"""Linear discriminant analysis with a shrunken covariance: many features, few speakers.

Class k has mean m_k and all classes share the covariance within them, S. With thousands of features and hundreds of
recordings S is singular, so a share s of it is replaced by its mean diagonal (Friedman 1989):

    S_s = (1 - s) S + s (tr S / F) I,        score_k(x) = m_k S_s^-1 x - m_k S_s^-1 m_k / 2.

Every class is taken for equally likely beforehand: how often somebody was recorded angry says nothing about a new voice.
With R = U diag(d) V the samples less their class means over sqrt(N), S = V^T diag(d²) V, so that S_s^-1 costs one
decomposition for all s.
"""

from collections.abc import Sequence
from itertools import combinations
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.errors import FacesynthError
from facesynth.methods.emotion.pairwise import Pairs, PairwiseClassifier, folds_of, require_classes

SHRINKAGES = (0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98)
"""Shares that are tried where none is given."""
Shrinkage = float | Literal["auto"]


def fit_discriminant(
    x: NDArray[np.float64], y: NDArray[np.int64], shrinkage: Shrinkage = "auto", groups: NDArray[Any] | None = None
) -> PairwiseClassifier:
    """Learn from scaled features x [N, F] and classes y [N] 0..K-1, all of which occur.

    shrinkage: s, above 0 and at most 1; `auto`: the one that recognises most on groups [N] (speakers, sentences) left out.
    """
    require_classes(y)
    share = _best(x, y, groups) if shrinkage == "auto" else shrinkage
    if not 0 < share <= 1:
        raise FacesynthError(f"shrinkage is {share}; wanted a share above 0 and at most 1, or auto")
    return PairwiseClassifier.fit(x, y, lambda some, classes: _pairs(*_scores(some, classes, [share])[0]), "linear", groups)


def _best(x: NDArray[np.float64], y: NDArray[np.int64], groups: NDArray[Any] | None) -> float:
    """The share of SHRINKAGES with the best unweighted recall on samples left out."""
    decided = np.full((len(SHRINKAGES), len(y)), -1)
    for train, test in folds_of(y, groups):
        if len(set(y[train].tolist())) == y.max() + 1:
            scores = _scores(x[train], y[train], SHRINKAGES)
            decided[:, test] = [(x[test] @ weights.T + offsets).argmax(axis=1) for weights, offsets in scores]
    seen = decided[0] >= 0
    if not seen.any():
        return SHRINKAGES[-1]
    right = decided == y
    recalls = np.mean([right[:, seen & (y == k)].mean(axis=1) for k in np.unique(y[seen])], axis=0)
    return SHRINKAGES[int(recalls.argmax())]


def _scores(
    x: NDArray[np.float64], y: NDArray[np.int64], shares: Sequence[float]
) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """For each share, weights [K, F] and offsets [K] of the score of each class."""
    means = np.array([x[y == k].mean(axis=0) for k in range(int(y.max()) + 1)])
    within = (x - means[y]) / np.sqrt(len(x))
    _, sizes, directions = np.linalg.svd(within, full_matrices=False)
    diagonal = float(np.square(sizes).mean() * len(sizes) / x.shape[1])
    found = []
    for share in shares:
        least = share * diagonal if diagonal > 0 else 1.0  # one sample of each class: the nearest one wins
        along = 1 / ((1 - share) * np.square(sizes) + least) - 1 / least
        weights = means / least + (means @ directions.T * along) @ directions
        found.append((weights, -(means * weights).sum(axis=1) / 2))
    return found


def _pairs(weights: NDArray[np.float64], offsets: NDArray[np.float64]) -> Pairs:
    """The margin of a pair is the difference of its scores: who has the highest score wins all of its pairs."""
    first, second = np.array(list(combinations(range(len(offsets)), 2))).T
    return Pairs(np.zeros((0, weights.shape[1])), weights[first] - weights[second], offsets[first] - offsets[second])
