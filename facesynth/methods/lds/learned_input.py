"""The system's input, learned: what a regression makes of the sound around a frame, in place of its largest components.

Principal components of the periodogram say what differs most between sounds, which is their level and who speaks; what
the lips do lies in small differences and before and after. So the spectra around a frame, each as principal components, are
mapped to the shape by ridge regression, u = x W. A system that is driven by u in the recordings must not see more of
them there than it will of new speech: each recording's u is that of weights which were learned from others.
"""

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from facesynth.methods.lds.recordings import Piece, Standardised, periodograms, require_change
from facesynth.methods.lds.system import Array
from facesynth.methods.learn.regression import Moments
from facesynth.motion.pca import Pca
from facesynth.speech.periodogram import COEFFICIENTS, Periodogram

FOLDS = 4
ALPHAS = 10.0 ** np.arange(-5, 1.1, 0.5)
"""Penalties tried, as shares of the mean variance of an input."""


def learned_input(
    pieces: list[Piece], shapes: Sequence[Array], periodogram: Periodogram, components: float
) -> tuple[Standardised, list[Array]]:
    """What encodes spectra [T, S 256] as input, and the input [T, p] of each piece, whose shapes [T, p] are given."""
    centre = Periodogram(periodogram.fps, periodogram.scale, periodogram.lead_ms)
    plain = periodograms(pieces, centre)
    require_change(np.concatenate(plain), "the sound")
    pca = Pca.fit(np.concatenate(plain), components)
    x = [_components(pca, piece, periodogram) for piece in pieces]
    parts = folds_of(pieces)
    weights, others = weights_of(x, shapes, parts)
    inputs = [apart(one, part, others) for one, part in zip(x, parts, strict=True)]
    stacked = np.concatenate(inputs)
    scale = np.maximum(stacked.std(axis=0), 1e-6 * stacked.std(axis=0).max())
    return _encoder(pca, weights, scale, stacked), [one / scale for one in inputs]


def _components(pca: Pca, piece: Piece, periodogram: Periodogram) -> NDArray[np.float32]:
    """[T, S k] principal components of each spectrum around each frame of a piece."""
    spectra = periodogram(torch.from_numpy(piece.audio), piece.stop)[piece.first :]
    return pca.encode(spectra.unflatten(-1, (periodogram.parts, COEFFICIENTS))).flatten(1).numpy()


def folds_of(pieces: Sequence[Piece]) -> list[NDArray[np.int64]]:
    """[T] the fold of each frame: by sentence, or of a single sentence by time."""
    number = {sentence: i % FOLDS for i, sentence in enumerate(sorted({piece.sentence for piece in pieces}))}
    if len(number) > 1:
        return [np.full(len(piece.frames), number[piece.sentence]) for piece in pieces]
    return [np.arange(len(piece.frames)) * FOLDS // len(piece.frames) for piece in pieces]


def weights_of(x: Sequence[Array], y: Sequence[Array], parts: Sequence[NDArray[np.int64]]) -> tuple[Array, list[Array]]:
    """Weights [S k, p] from everything, and from everything but each fold, with the penalty that predicts folds best."""
    sums = [Moments.zero(x[0].shape[1], y[0].shape[1]) for _ in range(FOLDS)]
    for one, shape, part in zip(x, y, parts, strict=True):
        for fold in np.unique(part):
            sums[fold].add(one[part == fold], shape[part == fold])
    used = [fold for fold in range(FOLDS) if sums[fold].count]
    together = _total([sums[fold] for fold in used])
    without = {fold: _total([sums[other] for other in used if other != fold]).solutions(ALPHAS) for fold in used}
    errors = [sum(sums[fold].error(*without[fold][k]) * sums[fold].count for fold in used) for k in range(len(ALPHAS))]
    best = int(np.argmin(errors))
    empty = np.zeros((x[0].shape[1], y[0].shape[1]))
    return together.solutions(ALPHAS)[best][0], [without[fold][best][0] if fold in used else empty for fold in range(FOLDS)]


def _total(sums: Sequence[Moments]) -> Moments:
    total = sums[0]
    for other in sums[1:]:
        total = total + other
    return total


def apart(x: Array, part: NDArray[np.int64], others: Sequence[Array]) -> Array:
    """[T, p] input of one piece, each frame's by the weights that were learned without its fold."""
    result = np.zeros((len(x), others[0].shape[1]))
    for fold in np.unique(part):
        result[part == fold] = x[part == fold] @ others[fold]
    return result


def _encoder(pca: Pca, weights: Array, scale: Array, inputs: Array) -> Standardised:
    """The regression as one matrix from spectra [S 256], its outputs held to the range of those in the recordings."""
    each = weights.reshape(-1, pca.basis.shape[1], weights.shape[1])  # [S, k, p]
    matrix = np.concatenate([pca.basis.numpy().astype(np.float64) @ one for one in each])
    mean = pca.mean.repeat(len(each))
    bounds = (inputs.min(axis=0) / scale, inputs.max(axis=0) / scale)
    low, high, size, basis = (torch.from_numpy(np.ascontiguousarray(a)).float() for a in (*bounds, scale, matrix))
    return Standardised(Pca(mean, basis, torch.zeros(basis.shape[1])), size, low, high)
