"""Weights of the search by descent from many places at once (Deng 2006, eq. 4.12 to 4.14)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from facesynth.inference.arrays import Floats
from facesynth.inference.head.search import Candidates, Scales, best_paths, poses_along

STEP = 0.05
MOST_STEPS = 25
DIRECTIONS = STEP * np.array([[0, -1, 1], [0, 1, -1], [1, 0, -1], [-1, 0, 1]])
"""[4, 3] of (Wn, Wr, Wa): weight goes from one error to another, the sum stays 1 (eq. 4.13)."""


@dataclass(frozen=True, eq=False)
class Segment:
    """A recording that was left out of the database, with its first and its last pose as key poses."""

    candidates: Candidates
    start: Floats
    """[6] the pose before the first frame."""
    truth: Floats
    """[T, 6]"""


@dataclass(frozen=True, eq=False)
class Found:
    """The best weights."""

    weights: Floats
    """[3] Wn, Wr, Wa."""
    error: float
    """Mean over frames of the squared distance, in the poses' standard deviations."""


def total_error(segments: Sequence[Segment], weights: Floats, scales: Scales, beam: int) -> Floats:
    """[W] TEE of eq. 4.12 for weights [W, 3], each channel in its standard deviation, over the number of frames."""
    total, frames = np.zeros(len(weights)), 0
    for segment in segments:
        _, chosen = best_paths(segment.candidates, weights, segment.start, scales, beam)
        poses = np.stack([poses_along(segment.candidates, path, segment.start) for path in chosen])
        total += np.square((poses - segment.truth) / scales.pose).sum(axis=(1, 2))
        frames += len(segment.truth)
    return total / frames


def search_weights(segments: Sequence[Segment], scales: Scales, beam: int, starts: int, rng: np.random.Generator) -> Found:
    """Descents from random places in the triangle of weights; the winner of all is taken."""
    away = rng.uniform(0, 1, starts)
    near = rng.uniform(0, 1 - away)
    weights = np.stack([near, 1 - away - near, away], axis=1)
    errors = total_error(segments, weights, scales, beam)
    moving = np.arange(starts)
    for _ in range(MOST_STEPS):
        around = weights[moving, None] + DIRECTIONS
        inside = (around >= 0).all(axis=2)
        tried = np.full(inside.shape, np.inf)
        tried[inside] = total_error(segments, around[inside], scales, beam) if inside.any() else np.inf
        best = tried.argmin(axis=1)
        better = tried[np.arange(len(moving)), best] < errors[moving]
        weights[moving[better]] = around[better, best[better]]
        errors[moving[better]] = tried[better, best[better]]
        moving = moving[better]
        if not len(moving):
            break
    winner = int(errors.argmin())
    return Found(weights[winner], float(errors[winner]))
