"""From weights of recorded transitions to polynomials by viseme class (Deng 2006, eq. 5.3 to 5.9)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from facesynth.inference.arrays import Floats, Ints
from facesynth.inference.coarticulation.blending import WeightModels
from facesynth.methods.coarticulation.decomposition import cosine_weights

DEGREE = 3
GRID = np.linspace(0, 1, 21)
PENALTIES = (0.0, 1e-5, 5e-5, 1e-4)
"""lambda of eq. 5.7 in fig. 5.8."""


@dataclass(frozen=True, eq=False)
class Transitions:
    """Frames of one kind of transition, over two or three phones."""

    classes: Ints
    """[T, n] viseme classes of its phones."""
    times: Floats
    """[T] 0 at the first sample, 1 at the last."""
    weights: Floats
    """[T, n] of the samples."""
    numbers: Ints
    """[T] which recorded transition a frame belongs to."""


def fit_polynomials(times: Floats, weights: Floats, degree: int, towards: Floats | None = None, pull: float = 0.0) -> Floats:
    """[n, degree + 1] coefficients, constant first, of least squares through weights [T, n] at times [T].

    towards: polynomials that count like `pull` further frames, spread evenly over the transition.
    """
    powers = np.vander(times, degree + 1, increasing=True)
    gram, right = powers.T @ powers, powers.T @ weights
    if towards is not None:
        grid = np.vander(GRID, degree + 1, increasing=True)
        share = pull / len(GRID)
        gram, right = gram + share * grid.T @ grid, right + share * grid.T @ (grid @ towards.T)
    return np.asarray(np.linalg.lstsq(gram, right, rcond=None)[0].T)


def learn_models(
    diphones: Transitions, triphones: Transitions, size: int, *, degree: int, pull: float, least: int
) -> WeightModels:
    """Polynomials of every pair of classes, and of the triples that were recorded at least `least` times.

    Each is drawn towards that of all pairs (or triples) together by `pull` frames; a pair that was never recorded has the
    common one, and without any recording a cosine blend.
    """
    common = fit_polynomials(diphones.times, diphones.weights, degree) if len(diphones.times) else cosine_polynomials(degree)
    pairs = np.tile(common, (size, size, 1, 1))
    for key, rows in by_classes(diphones).items():
        pairs[key] = fit_polynomials(diphones.times[rows], diphones.weights[rows], degree, common, pull)
    keys, triples = [], []
    if len(triphones.times):
        shared = fit_polynomials(triphones.times, triphones.weights, degree)
        for key, rows in sorted(by_classes(triphones).items()):
            if len(np.unique(triphones.numbers[rows])) >= least:
                keys.append(key)
                triples.append(fit_polynomials(triphones.times[rows], triphones.weights[rows], degree, shared, pull))
    shape = (len(keys), 3, degree + 1)
    return WeightModels(pairs, np.array(keys, np.int64).reshape(-1, 3), np.array(triples, np.float64).reshape(shape))


def cosine_polynomials(degree: int) -> Floats:
    """[2, degree + 1] the polynomials nearest to a cosine blend."""
    return fit_polynomials(GRID, cosine_weights(GRID), degree)


def by_classes(transitions: Transitions) -> Mapping[tuple[int, ...], Ints]:
    """Rows of each combination of viseme classes."""
    found, inverse = np.unique(transitions.classes, axis=0, return_inverse=True)
    order = np.argsort(inverse.ravel(), kind="stable")
    bounds = np.searchsorted(inverse.ravel()[order], np.arange(len(found) + 1))
    return {tuple(key): order[a:b] for key, a, b in zip(found.tolist(), bounds[:-1], bounds[1:], strict=True)}


def fitting_cost(kinds: Sequence[Transitions], degree: int, penalty: float) -> float:
    """C(lambda) of eq. 5.7 to 5.9: squared errors of all fits, and lambda times the squares of their coefficients."""
    total = 0.0
    for transitions in kinds:
        for rows in by_classes(transitions).values():
            times, weights = transitions.times[rows], transitions.weights[rows]
            polynomials = fit_polynomials(times, weights, degree)
            errors = np.vander(times, degree + 1, increasing=True) @ polynomials.T - weights
            total += float(np.square(errors).sum() + penalty * np.square(polynomials).sum())
    return total
