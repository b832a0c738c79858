"""Vector quantisation by splitting (Linde, Buzo, Gray 1980)."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist

from facesynth.inference.arrays import Floats, Ints

SPLIT = 0.01
"""The second half of a cell begins so many standard deviations beside its mean."""
SETTLED = 1e-4
"""A distortion that falls by a smaller share has settled."""
MOST_ROUNDS = 100


@dataclass(frozen=True, eq=False)
class Codebook:
    """Cells of space and who is in them; none is empty."""

    means: Floats
    """[K, D]"""
    labels: Ints
    """[N] the nearest mean of each point."""
    distortions: tuple[float, ...]
    """Mean squared distance to the nearest mean, round after round; it never rises."""


def codebook(points: Floats, size: int) -> Codebook:
    """At most `size` cells for points [N, D]: all are split in two, those with most distortion first, and settled by Lloyd."""
    distortions: list[float] = []
    means, labels = _settled(points, points.mean(axis=0, keepdims=True), distortions)
    while len(means) < size:
        spread = np.stack([points[labels == k].std(axis=0) for k in range(len(means))])
        sizes = np.bincount(labels, minlength=len(means)) * np.square(spread).sum(axis=1)
        halved = np.argsort(-sizes, kind="stable")[: size - len(means)]
        halved = halved[sizes[halved] > 0]
        if not len(halved):
            break
        before = means
        # The mean of a cell stays, and the other half begins beside it: a split cannot raise the distortion.
        means, labels = _settled(points, np.concatenate([means, means[halved] + SPLIT * spread[halved]]), distortions)
        if np.array_equal(means, before):  # a half beside which no point lies, as between (1, -1) and (-1, 1), comes again
            break
    return Codebook(means, labels, tuple(distortions))


def _settled(points: Floats, means: Floats, distortions: list[float]) -> tuple[Floats, Ints]:
    """Lloyd's rounds; cells that nobody is in are left out."""
    for _ in range(MOST_ROUNDS):
        labels = cdist(points, means, "sqeuclidean").argmin(axis=1)
        _used, labels, counts = np.unique(labels, return_inverse=True, return_counts=True)
        sums = np.stack([np.bincount(labels, weights=column) for column in points.T], axis=1)
        means = sums / counts[:, None]
        distortion = float(np.square(points - means[labels]).sum(axis=1).mean())
        settled = len(distortions) > 0 and distortion > (1 - SETTLED) * distortions[-1]
        distortions.append(distortion)
        if settled:
            break
    return means, labels
