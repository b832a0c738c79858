"""The stochastic part: realisation from the canonical correlations of past and future."""

from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.linalg import cholesky, solve_discrete_are, solve_triangular, svd

from facesynth.inference.errors import FacesynthError
from facesynth.methods.lds.deterministic import stabilised
from facesynth.methods.lds.regression import solve, triangle
from facesynth.methods.lds.system import Array, Stochastic

FRAMES_FOR_A_PAST = 30
"""Frames there must be for each number of the past that the noise is predicted from; fewer make it fit what never recurs."""
FEWEST_ROWS = 2


def noise_rows(frames: int, rows: int, outputs: int) -> int:
    """Block rows for the stochastic part: `rows`, or as few as a recording of so many frames bears."""
    return max(FEWEST_ROWS, min(rows, frames // (FRAMES_FOR_A_PAST * outputs)))


def predictor_space(signals: Sequence[Array], rows: int) -> tuple[Array, Array]:
    """What of the past of y_s predicts its future: [k p, k p] functionals, strongest first, and canonical correlations.

    With the covariances of past and future, R_ff^-1/2 R_fp R_pp^-T/2 = U S V^T, the states are
    x(t) = S^1/2 V^T R_pp^-1/2 y_p(t). Both square roots come out of one triangle: in
    [Y_p, Y_f] = Q [[R11, R12], [0, R22]] the past's is R11, and the normalised cross-covariance is R12
    divided by the root of the future's R12^T R12 + R22^T R22.
    """
    p = signals[0].shape[1]
    r = triangle(_windows(y, 2 * rows) for y in signals if len(y) >= 2 * rows)
    past, cross, future = r[: rows * p, : rows * p], r[: rows * p, rows * p :], r[:, rows * p :]
    normalised = solve_triangular(cholesky(future.T @ future), cross.T, trans="T")
    _, correlations, Vt = svd(normalised)
    return np.sqrt(correlations)[:, None] * solve_triangular(past, Vt.T).T, correlations


def realise(signals: Sequence[Array], rows: int, functionals: Array, order: int) -> tuple[Stochastic, tuple[float, ...]]:
    """Innovation model of y_s with `order` states, and the moduli of eigenvalues that had to be moved inside.

    [x(t+1); y(t)] regressed on x(t) gives A, C and the residual covariance [[Q, S], [S^T, R]]; the
    Riccati equation P = A P A^T + Q - (A P C^T + S)(C P C^T + R)^-1 (A P C^T + S)^T gives the gain.
    Its stabilising solution makes A - B C stable: the model is minimum phase.
    """
    p = signals[0].shape[1]
    r = triangle(_regression_rows(y, rows, functionals[:order]) for y in signals if len(y) > rows + 1)
    frames = sum(max(len(y) - rows, 0) for y in signals)
    AC = solve(r, order).T
    A, repaired = stabilised(AC[:order])
    AC = np.vstack([A, AC[order:]])
    residual = r[:, order:] - r[:, :order] @ AC.T
    QSR = residual.T @ residual / frames
    B, covariance = _kalman_gain(A, AC[order:], QSR)
    return Stochastic(A, B, AC[order:].reshape(p, order), covariance), repaired


def _kalman_gain(A: Array, C: Array, QSR: Array) -> tuple[Array, Array]:
    n = len(A)
    Q, S, R = QSR[:n, :n], QSR[:n, n:], QSR[n:, n:]
    try:
        P = solve_discrete_are(A.T, C.T, Q, R, s=S)
    except np.linalg.LinAlgError:
        raise FacesynthError(
            f"no noise model with {n} states fits this motion (the Riccati equation has no stable solution); "
            "ask for fewer noise states or fewer shape components"
        ) from None
    innovation = C @ P @ C.T + R
    return np.linalg.solve(innovation, (A @ P @ C.T + S).T).T, innovation


def _windows(y: Array, length: int) -> Array:
    """[T - length + 1, length p]"""
    windows = sliding_window_view(y, length, axis=0).transpose(0, 2, 1)
    return windows.reshape(len(windows), -1)


def _regression_rows(y: Array, rows: int, functionals: Array) -> Array:
    """Rows [x(t) | x(t+1), y(t)] of one clip, x(t) from the `rows` frames before t."""
    x = _windows(y, rows) @ functionals.T
    return np.hstack([x[:-1], x[1:], y[rows:]])
