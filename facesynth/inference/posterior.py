"""How probable each state of a chain is, where every path counts by the exponential of its score."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .arrays import Floats
from .ragged import Made, Ragged


@dataclass(frozen=True, eq=False)
class Posterior:
    """Logarithms of sums over paths, T positions of n_t states."""

    scores: Sequence[Floats]
    moves: Sequence[Floats]
    forward: Sequence[Floats]
    backward: Sequence[Floats]

    def shares(self) -> Sequence[Floats]:
        """T of [n_t] probabilities."""
        both = (a + b for a, b in zip(self.forward, self.backward, strict=True))
        return Ragged(np.float64, (np.exp(score - log_sum(score, 0)) for score in both))

    def of_steps(self, t: int, row: NDArray[np.int64], column: NDArray[np.int64]) -> Floats:
        """[n] probabilities of the steps from states `row` at t to states `column` at t + 1."""
        onward = (self.scores[t + 1] + self.backward[t + 1])[column]
        return np.exp(self.forward[t][row] + self.moves[t][row, column] + onward - log_sum(self.forward[-1], 0))


def posterior(scores: Sequence[Floats], moves: Sequence[Floats]) -> Posterior:
    """scores T of [n_t], moves T - 1 of [n_t, n_t+1]; -cost / temperature each."""
    last = np.asarray(scores[0], np.float64)
    forward = Ragged().add(last)
    for t, move in enumerate(moves, 1):
        last = log_sum(last[:, None] + move, 0) + scores[t]
        forward.add(last)
    last = np.zeros(len(scores[-1]))
    backward = Ragged().add(last)
    for t in range(len(scores) - 1, 0, -1):
        last = log_sum(moves[t - 1] + (scores[t] + last), 1)
        backward.add(last)
    return Posterior(scores, moves, forward, Made(lambda t: backward[len(backward) - 1 - t], len(backward)))


def log_sum(x: Floats, axis: int) -> Floats:
    """Logarithm of the sum of exponentials along an axis."""
    most = x.max(axis=axis, keepdims=True)
    return np.asarray(np.log(np.exp(x - most).sum(axis=axis)) + np.squeeze(most, axis))
