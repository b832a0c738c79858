"""The deterministic part: subspace from the inputs' projection, then linear least squares."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.linalg import schur, svd

from facesynth.methods.lds.regression import solve, triangle
from facesynth.methods.lds.system import Array, Clip, Deterministic, Stochastic, propagate

BLOCK = 2000
"""Frames per block of the regressions, which bounds their memory."""
STABLE = 0.995
"""Where the modulus of an unstable eigenvalue is moved to."""


def observability(clips: Sequence[Clip], rows: int) -> tuple[Array, Array]:
    """Extended observability matrix of the deterministic part and its singular values.

    Orthogonal decomposition (Picci and Katayama 1996, Chiuso and Picci 1999). With block Hankel
    matrices of k rows, whose columns never cross clips,

        [U_f; U_p; Y_p; Y_f] = L Q^T,

    L41 and L42 are the part of the future outputs that lies in the space of all inputs. L42 is
    what the past inputs add to the future ones, and they can act only through the state: its column
    space is that of [C; C A; …; C A^(k-1)].

    Returns [k p, min(k p, k m)], weighted by the square roots of the singular values, and those.
    """
    m, p = clips[0].u.shape[1], clips[0].y.shape[1]
    r = triangle(_hankel_columns(clip, rows) for clip in clips if len(clip.u) >= 2 * rows)
    L42 = r[rows * m : 2 * rows * m, -rows * p :].T
    U, singular, _ = svd(L42, full_matrices=False)
    return U * np.sqrt(singular), singular


def _hankel_columns(clip: Clip, rows: int) -> Array:
    """The columns of one clip, as rows: [T - 2k + 1, 2k (m + p)] in the order U_f, U_p, Y_p, Y_f."""
    u = sliding_window_view(clip.u, 2 * rows, axis=0).transpose(0, 2, 1)
    y = sliding_window_view(clip.y, 2 * rows, axis=0).transpose(0, 2, 1)
    parts = (u[:, rows:], u[:, :rows], y[:, :rows], y[:, rows:])
    return np.hstack([part.reshape(len(part), -1) for part in parts])


def shift_invariance(gamma: Array, outputs: int, order: int) -> tuple[Array, Array]:
    """A [n, n] and C [p, n] from the observability matrix: its last rows are its first rows times A."""
    gamma = gamma[:, :order]
    return np.linalg.lstsq(gamma[:-outputs], gamma[outputs:], rcond=None)[0], gamma[:outputs]


def stabilised(A: Array) -> tuple[Array, tuple[float, ...]]:
    """A with eigenvalues of modulus 1 and more moved to 0.995 (in Schur form), and the moduli that were."""
    T, Z = schur(A, output="complex")
    eigenvalues = np.diag(T).copy()
    outside = np.abs(eigenvalues) >= 1
    if not outside.any():
        return A, ()
    moved = np.where(outside, STABLE * eigenvalues / np.abs(eigenvalues), eigenvalues)
    np.fill_diagonal(T, moved)
    return (Z @ T @ Z.conj().T).real, tuple(np.abs(eigenvalues[outside]).tolist())


def fit_inputs(A: Array, C: Array, clips: Sequence[Clip], noise: Stochastic | None) -> tuple[Deterministic, tuple[Array, ...]]:
    """B, D and each clip's initial state by linear least squares, A and C given.

    The output is linear in all of them: y = C A^t x(0) + sum_ij B_ij (response to u_j at state i)
    + sum_ij D_ij u_j(t). Each clip's initial state is eliminated within the clip, so that two
    hundred clips cost no more than one long one. With a noise model, regressors and outputs pass
    through its inverse and the inverse square root of its covariance first: generalised least squares.
    """
    (n, p), m = (len(A), len(C)), clips[0].u.shape[1]
    unknowns = n * m + p * m
    triangles = [triangle(_regression_rows(A, C, clip, noise)) for clip in clips]
    theta = solve(triangle(r[n:, n:] for r in triangles if len(r) > n), unknowns)
    starts = tuple(
        solve(np.hstack([r[:n, :n], r[:n, n + unknowns :] - r[:n, n : n + unknowns] @ theta]), n)[:, 0] for r in triangles
    )
    return Deterministic(A, theta[: n * m, 0].reshape(n, m), C, theta[n * m :, 0].reshape(p, m)), starts


def _regression_rows(A: Array, C: Array, clip: Clip, noise: Stochastic | None) -> Iterator[Array]:
    """Blocks [T' p, n + n m + p m + 1] of regressors for x(0), B, D, and the output."""
    (n, p), m = (len(A), len(C)), clip.u.shape[1]
    state = np.hstack([np.eye(n), np.zeros((n, n * m))])
    filtered: Array | None = None
    for first in range(0, len(clip.u), BLOCK):
        u, y = clip.u[first : first + BLOCK], clip.y[first : first + BLOCK]
        drive = np.zeros((len(u), n, n + n * m))
        drive[:, :, n:] = np.einsum("ni,tj->tnij", np.eye(n), u).reshape(len(u), n, n * m)
        states, state = propagate(A, drive, state)
        through_d = np.einsum("pi,tj->tpij", np.eye(p), u).reshape(len(u), p, p * m)
        bundle = np.concatenate([np.einsum("pn,tnr->tpr", C, states), through_d, y[:, :, None]], axis=2)
        if noise is not None:
            bundle, filtered = noise.innovations(bundle, filtered)
            bundle = np.linalg.solve(np.linalg.cholesky(noise.covariance), bundle)
        yield bundle.reshape(len(u) * p, -1)
