"""Bounded, temporally regularised least squares: weights of linear shapes that come closest to targets over time."""

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from facesynth.inference.errors import FacesynthError

TOLERANCE = 2e-5
"""The solver stops when a sweep over all weights moves none by more than this."""
MAX_SWEEPS = 2000
SMOOTHING_S = 0.003
"""Time constant with which a weight that nothing else explains follows its markers."""


def solve(
    shapes: ArrayLike,
    targets: ArrayLike,
    ridge: ArrayLike,
    *,
    fps: float,
    smoothing_s: float = SMOOTHING_S,
    tolerance: float = TOLERANCE,
) -> NDArray[np.float64]:
    """Weights [T, N] in 0..1 that bring N linear shapes [N, M] closest to targets [T, M].

    Minimises `sum_t |w_t A - b_t|² + sum_k ridge_k w_tk² + sum_k mu_k (w_tk - w_t-1,k)²` over 0 <= w <= 1, with
    `mu_k = |A_k|² (smoothing_s fps)²`: the time constant is the same at any frame rate and for any shape.
    Zero targets give zero weights. Memory grows with T. Stops when no weight moves by more than `tolerance`
    in a sweep.
    """
    basis, wanted, price = (np.asarray(value, np.float64) for value in (shapes, targets, ridge))
    if basis.ndim != 2 or wanted.ndim != 2 or basis.shape[1] != wanted.shape[1] or price.shape != (len(basis),):
        raise FacesynthError(
            f"shapes [N, M], targets [T, M] and ridge [N] do not fit: got {basis.shape}, {wanted.shape}, {price.shape}"
        )
    if not np.isfinite(wanted).all():
        raise FacesynthError("targets hold NaN or infinite values; fill the gaps of the motion first")
    gram = basis @ basis.T
    stiffness = np.diag(gram) * (smoothing_s * fps) ** 2
    weights = np.zeros((len(wanted), len(basis)))
    _descend(gram + np.diag(price), wanted @ basis.T, stiffness, weights, tolerance)
    return weights


# Coordinate descent. With H = A A' + diag(ridge) and the neighbouring frames held, the best value of one weight is
#   w_tk = clip((b_tk - sum_{j != k} H_kj w_tj + mu_k (w_{t-1,k} + w_{t+1,k})) / (H_kk + n mu_k), 0, 1)
# with n neighbours (2, or 1 at the ends). Sweeps run forwards and backwards in turn. The problem is strictly convex
# with a box, so that the sweeps converge to its one minimum; `slope` keeps b_t - H w_t, one frame at a time.
@njit(cache=True)
def _descend(H, b, mu, w, tolerance):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    T, N = w.shape
    slope = np.empty(N)
    for sweep in range(MAX_SWEEPS):
        moved = 0.0
        for step in range(T):
            t = step if sweep % 2 == 0 else T - 1 - step
            for k in range(N):
                slope[k] = b[t, k]
            for j in range(N):
                if w[t, j] != 0.0:
                    for k in range(N):
                        slope[k] -= H[j, k] * w[t, j]
            for k in range(N):
                pull, neighbours = 0.0, 0
                if t > 0:
                    pull, neighbours = pull + w[t - 1, k], neighbours + 1
                if t < T - 1:
                    pull, neighbours = pull + w[t + 1, k], neighbours + 1
                old = w[t, k]
                best = (slope[k] + H[k, k] * old + mu[k] * pull) / (H[k, k] + mu[k] * neighbours)
                new = min(max(best, 0.0), 1.0)
                if new != old:
                    w[t, k] = new
                    for j in range(N):
                        slope[j] -= H[k, j] * (new - old)
                    moved = max(moved, abs(new - old))
        if moved < tolerance:
            return
