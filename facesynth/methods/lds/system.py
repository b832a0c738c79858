"""Linear systems in innovation form: what identification finds and synthesis runs.

The model (Saisan 2004, eq. 3) adds a deterministic part that the sound drives and a stochastic one
that white noise drives:

    x_d(t+1) = A_d x_d(t) + B_d u(t)        y(t) = C_d x_d(t) + D_d u(t) + y_s(t)
    x_s(t+1) = A_s x_s(t) + B_s e(t)        y_s(t) = C_s x_s(t) + e(t)

Arrays are float64, time first: signals [T, channels], bundles of R signals [T, channels, R].
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


@dataclass(frozen=True, eq=False)
class Clip:
    """One uninterrupted recording: the input and the output of the system."""

    u: Array
    """[T, m] features of the sound."""
    y: Array
    """[T, p] shape."""

    def centred(self) -> "Clip":
        """The same with zero means."""
        return Clip(self.u - self.u.mean(axis=0), self.y - self.y.mean(axis=0))


@dataclass(frozen=True, eq=False)
class Deterministic:
    """The part that the sound drives (eq. 6)."""

    A: Array
    """[n, n]"""
    B: Array
    """[n, m]"""
    C: Array
    """[p, n]"""
    D: Array
    """[p, m]"""

    @property
    def order(self) -> int:
        """n, number of states."""
        return len(self.A)

    def simulate(self, u: Array, start: Array | None = None) -> Array:
        """Outputs [T, p] for inputs [T, m], from state `start` [n], which is zero where it is left out."""
        states, _ = propagate(self.A, (u @ self.B.T)[:, :, None], _column(start, self.order))
        return states[:, :, 0] @ self.C.T + u @ self.D.T

    def transfer(self, z: Array) -> Array:
        """F(z) = C (zI - A)^-1 B + D at complex points z [Z]: [Z, p, m]."""
        return _resolvent(self.A, self.B, self.C, z) + self.D


@dataclass(frozen=True, eq=False)
class Stochastic:
    """The part that noise drives, in innovation form (eq. 7)."""

    A: Array
    """[n, n]"""
    B: Array
    """[n, p] the Kalman gain."""
    C: Array
    """[p, n]"""
    covariance: Array
    """[p, p] of the innovation e."""

    @property
    def order(self) -> int:
        """n, number of states."""
        return len(self.A)

    @property
    def inverse(self) -> Array:
        """[n, n] state matrix of the inverse system, A - B C; its eigenvalues are the zeros of the model."""
        return self.A - self.B @ self.C

    def simulate(self, e: Array, start: Array | None = None) -> Array:
        """Outputs [T, p] for innovations [T, p]."""
        states, _ = propagate(self.A, (e @ self.B.T)[:, :, None], _column(start, self.order))
        return states[:, :, 0] @ self.C.T + e

    def innovations(self, y: Array, start: Array | None = None) -> tuple[Array, Array]:
        """The inverse system (eq. 9): one-step prediction errors of y [T, p, R], and the state after them [n, R]."""
        drive = np.einsum("np,tpr->tnr", self.B, y)
        first = np.zeros((self.order, y.shape[2])) if start is None else start
        states, last = propagate(self.inverse, drive, first)
        return y - np.einsum("pn,tnr->tpr", self.C, states), last

    def transfer(self, z: Array) -> Array:
        """G(z) = C (zI - A)^-1 B + I at complex points z [Z]: [Z, p, p]."""
        return _resolvent(self.A, self.B, self.C, z) + np.eye(len(self.C))


@dataclass(frozen=True, eq=False)
class LinearSystem:
    """Both parts, with what the identification found on the way."""

    deterministic: Deterministic
    stochastic: Stochastic
    starts: tuple[Array, ...]
    """The deterministic part's state [n] at the first frame of each clip."""
    singular_values: Array
    """Of the projection that shows the deterministic order."""
    correlations: Array
    """Canonical correlations of past and future of y_s, which show the stochastic order."""
    repaired: tuple[float, ...]
    """|lambda| of the eigenvalues that were at 1 or beyond and were moved inside."""

    def poles(self) -> dict[str, list[float]]:
        """Moduli, largest first, of the eigenvalues of A_d, A_s and A_s - B_s C_s; all are below 1."""
        matrices = {"A_d": self.deterministic.A, "A_s": self.stochastic.A, "A_s - B_s C_s": self.stochastic.inverse}
        return {name: sorted(np.abs(np.linalg.eigvals(matrix)).tolist(), reverse=True) for name, matrix in matrices.items()}

    def stochastic_output(self, clips: tuple[Clip, ...]) -> list[Array]:
        """y_s = y - y_d of each clip that was learned from, [T, p]."""
        return [clip.y - self.deterministic.simulate(clip.u, start) for clip, start in zip(clips, self.starts, strict=True)]


def propagate(A: Array, drive: Array, start: Array) -> tuple[Array, Array]:
    """x(t+1) = A x(t) + drive(t) for R signals at once.

    Parameters: A [n, n]; drive [T, n, R]; start [n, R]. Returns the states x(0) … x(T-1) as [T, n, R], and x(T) as [n, R].
    """
    states = np.empty((len(drive) + 1, *start.shape))
    states[0] = start
    for t, push in enumerate(drive):
        states[t + 1] = A @ states[t] + push
    return states[:-1], states[-1]


def _column(start: Array | None, order: int) -> Array:
    return np.zeros((order, 1)) if start is None else np.asarray(start, np.float64).reshape(order, 1)


def _resolvent(A: Array, B: Array, C: Array, z: Array) -> Array:
    shifted = z[:, None, None] * np.eye(len(A)) - A
    return C @ np.linalg.solve(shifted, np.broadcast_to(B, (len(z), *B.shape)).astype(complex))
