"""How much each phone's sample counts in a recorded frame: non-negative least squares, all frames at once."""

from itertools import combinations

import numpy as np

from facesynth.inference.arrays import Floats


def decompose(frames: Floats, samples: Floats, prior: Floats, stiffness: float) -> Floats:
    """[T, n] weights W >= 0 that minimise |frame - sum_k W_k sample_k|² + stiffness · |W - prior|² (Deng 2006, eq. 5.2, 5.6).

    frames [T, D], samples [T, n, D] (n is 2 or 3), prior [T, n]; stiffness [T] or a number, in squared units of the frames.
    With so few weights every choice of those that may be positive is solved, and the best feasible one taken: the exact optimum.
    """
    count = samples.shape[1]
    gram = np.einsum("tid,tjd->tij", samples, samples)
    stiff = np.broadcast_to(np.asarray(stiffness, np.float64), len(frames))
    gram = gram + stiff[:, None, None] * np.eye(count)
    right = np.einsum("tid,td->ti", samples, frames) + stiff[:, None] * prior
    best, weights = np.zeros(len(frames)), np.zeros((len(frames), count))
    for size in range(1, count + 1):
        for free in combinations(range(count), size):
            chosen = np.array(free)
            solved = np.linalg.solve(gram[:, chosen[:, None], chosen], right[:, chosen, None])[..., 0]
            # The objective at the solution of the normal equations, up to a constant: -right · W.
            cost = -np.einsum("ti,ti->t", right[:, chosen], solved)
            better = (solved >= 0).all(axis=1) & (cost < best)
            weights[better] = 0.0
            weights[np.flatnonzero(better)[:, None], chosen] = solved[better]
            best[better] = cost[better]
    return weights


def linear_weights(t: Floats, count: int) -> Floats:
    """[T, count] of straight lines between `count` samples at even times: what a frame is without anything learned."""
    places = np.linspace(0, 1, count)
    return np.asarray(np.clip(1 - np.abs(t[:, None] - places) * (count - 1), 0, 1))


def cosine_weights(t: Floats) -> Floats:
    """[T, 2] of the blend that stands in where no diphone was recorded."""
    rise = (1 - np.cos(np.pi * t)) / 2
    return np.stack([1 - rise, rise], axis=1)
