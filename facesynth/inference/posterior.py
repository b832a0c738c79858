"""How probable each state of a chain is, where every path counts by the exponential of its score."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .arrays import Floats


@dataclass(frozen=True, eq=False)
class Posterior:
    """Logarithms of sums over paths, T positions of n_t states."""

    scores: Sequence[Floats]
    moves: Sequence[Floats]
    forward: Sequence[Floats]
    backward: Sequence[Floats]

    def shares(self) -> list[Floats]:
        """T of [n_t] probabilities."""
        return [np.exp(a + b - log_sum(a + b, 0)) for a, b in zip(self.forward, self.backward, strict=True)]

    def of_steps(self, t: int, row: NDArray[np.int64], column: NDArray[np.int64]) -> Floats:
        """[n] probabilities of the steps from states `row` at t to states `column` at t + 1."""
        onward = (self.scores[t + 1] + self.backward[t + 1])[column]
        return np.exp(self.forward[t][row] + self.moves[t][row, column] + onward - log_sum(self.forward[-1], 0))


def posterior(scores: Sequence[Floats], moves: Sequence[Floats]) -> Posterior:
    """scores T of [n_t], moves T - 1 of [n_t, n_t+1]; -cost / temperature each."""
    forward, backward = [scores[0]], [np.zeros(len(scores[-1]))]
    for move, score in zip(moves, scores[1:], strict=True):
        forward.append(log_sum(forward[-1][:, None] + move, 0) + score)
    for move, score in zip(moves[::-1], scores[:0:-1], strict=True):
        backward.append(log_sum(move + (score + backward[-1]), 1))
    return Posterior(scores, moves, forward, backward[::-1])


def log_sum(x: Floats, axis: int) -> Floats:
    """Logarithm of the sum of exponentials along an axis."""
    most = x.max(axis=axis, keepdims=True)
    return np.asarray(np.log(np.exp(x - most).sum(axis=axis)) + np.squeeze(most, axis))
