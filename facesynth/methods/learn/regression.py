"""Ridge regression from sums over samples: memory does not grow with the recordings."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray


@dataclass
class Moments:
    """Sums of x [N, I], y [N, O] and their products: all that least squares needs, whatever N is."""

    count: int
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    xx: NDArray[np.float64]
    xy: NDArray[np.float64]
    yy: float

    @classmethod
    def zero(cls, inputs: int, outputs: int) -> Self:
        """Of no samples."""
        return cls(0, np.zeros(inputs), np.zeros(outputs), np.zeros((inputs, inputs)), np.zeros((inputs, outputs)), 0.0)

    def add(self, x: NDArray[np.floating], y: NDArray[np.floating]) -> None:
        """Count samples x [N, I], y [N, O]; products in their own type (standardised inputs bear float32), sums in float64."""
        self.count += len(x)
        self.x += x.sum(axis=0, dtype=np.float64)
        self.y += y.sum(axis=0, dtype=np.float64)
        self.xx += x.T @ x
        self.xy += x.T @ y
        self.yy += float(np.square(y, dtype=np.float64).sum())

    def __add__(self, other: "Moments") -> "Moments":
        return Moments(*(getattr(self, name) + getattr(other, name) for name in ("count", "x", "y", "xx", "xy", "yy")))

    def solutions(self, alphas: Iterable[float]) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Weights [I, O] and bias [O] for each penalty, a share of an input's mean variance; one eigendecomposition for all."""
        x, y = self.x / self.count, self.y / self.count
        variance, directions = np.linalg.eigh(self.xx / self.count - np.outer(x, x))
        along = directions.T @ (self.xy / self.count - np.outer(x, y))
        scale = variance.clip(min=0).mean()
        weights = [directions @ (along / (variance.clip(min=0) + alpha * scale)[:, None]) for alpha in alphas]
        return [(w, y - x @ w) for w in weights]

    def solution(self, alpha: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The same for one penalty above 0, a tenth of the work."""
        x, y = self.x / self.count, self.y / self.count
        spread = self.xx / self.count - np.outer(x, x)
        penalty = alpha * np.trace(spread) / len(spread)
        weights = np.linalg.solve(spread + penalty * np.eye(len(spread)), self.xy / self.count - np.outer(x, y))
        return weights, y - x @ weights

    def error(self, weights: NDArray[np.float64], bias: NDArray[np.float64]) -> float:
        """Mean over the samples of ‖x W + b - y‖²."""
        predicted = np.sum(weights * (self.xx @ weights)) + 2 * self.x @ weights @ bias + self.count * bias @ bias
        return float((predicted - 2 * np.sum(weights * self.xy) - 2 * self.y @ bias + self.yy) / self.count)
