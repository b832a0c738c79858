"""Dynamic time-warping of audio features, over all candidates of a phone at once (Cao 2005, eq. 5)."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints

MOST_CELLS = 1 << 22
"""Numbers that a batch of warps may hold at once."""


def audio_costs(wanted: Floats, features: Floats, starts: Ints, stops: Ints) -> Floats:
    """[n] mean over the frames of wanted [m, P] of ‖wanted(k) - warped candidate(k)‖ (eq. 5).

    Candidate n has the frames `features[starts[n]:stops[n]]` of features [G, P]. The warped candidate at k is the mean
    of the frames that warping matches with k.
    """
    costs, lengths = np.empty(len(starts)), stops - starts
    order, at = np.argsort(lengths, kind="stable"), 0
    while at < len(order):
        most = MOST_CELLS // (len(wanted) * int(lengths[order[-1]]) * wanted.shape[1])
        batch = order[at : at + max(1, most)]
        costs[batch] = _costs(wanted, features, starts[batch], lengths[batch])
        at += len(batch)
    return costs


def warp_path(wanted: Floats, heard: Floats) -> Floats:
    """[m] the place in heard [L, P], in frames 0..L-1, that warping matches with each frame of wanted [m, P]."""
    return warp_paths(wanted, [heard])[0]


def warp_paths(wanted: Floats, heard: Sequence[Floats]) -> list[Floats]:
    """The same for several candidates [L, P] at once."""
    lengths = np.array([len(frames) for frames in heard])
    padded = np.stack([frames[np.minimum(np.arange(lengths.max()), len(frames) - 1)] for frames in heard])
    first, last = _matches(wanted, padded, lengths)
    return list(((first + last) / 2).T)


def _costs(wanted: Floats, features: Floats, starts: Ints, lengths: Ints) -> Floats:
    place = np.minimum(np.arange(int(lengths.max())), lengths[:, None] - 1)
    heard = features[starts[:, None] + place]  # [n, L, P]
    first, last = _matches(wanted, heard, lengths)
    sums = np.concatenate([np.zeros_like(heard[:, :1]), heard.cumsum(axis=1)], axis=1)
    row = np.arange(len(starts))
    means = (sums[row, last + 1] - sums[row, first]) / (last - first + 1)[..., None]  # [m, n, P]
    result: Floats = np.sqrt(np.square(wanted[:, None] - means).sum(axis=2)).mean(axis=0)
    return result


# The least sum of distances on a monotone way from (0, 0) to (m - 1, L - 1) fills a table of m by L. A cell waits for the
# cells above, beside and diagonally above it alone, so that all cells of one anti-diagonal, of all candidates, are one step.
# Diagonal d is kept by its rows: its cell k is (k, d - k), and cells outside of the table are infinitely far.
# Steps: 0 both advance, 1 only the input (the candidate holds), 2 only the candidate; of equal ones the first.
def _matches(wanted: Floats, heard: Floats, lengths: Ints) -> tuple[Ints, Ints]:
    """First and last frame [m, n] of each candidate heard [n, L, P] that each frame of wanted is matched with."""
    m, (n, length) = len(wanted), heard.shape[:2]
    apart = np.full((m + length - 1, m, n), np.inf)
    for k, frame in enumerate(wanted):
        apart[k : k + length, k] = np.sqrt(np.square(heard - frame).sum(axis=2)).T
    steps = np.empty((m + length - 1, m, n), np.uint8)
    before, last = np.full((2, m + 1, n), np.inf)  # the two diagonals before; row k of the table is row k + 1 here
    last[1] = apart[0, 0]
    for d in range(1, m + length - 1):
        both, held, passed = before[:-1], last[:-1], last[1:]
        best = np.minimum(both, held)
        np.minimum(best, passed, out=best)
        steps[d] = np.where(both <= best, 0, np.where(held <= best, 1, 2))
        before, last = last, before
        np.add(best, apart[d], out=last[1:])
    return _traced(steps, lengths)


def _traced(steps: NDArray[np.uint8], lengths: Ints) -> tuple[Ints, Ints]:
    """All ways back from their ends together; steps [diagonal, row, n]."""
    _, m, n = steps.shape
    row, k, f = np.arange(n), np.full(n, m - 1), lengths - 1
    first, last = np.zeros((2, m, n), np.int64)
    last[k, row] = f
    while True:
        first[k, row] = f
        walking = np.flatnonzero((k > 0) | (f > 0))
        if not len(walking):
            return first, last
        step = steps[k[walking] + f[walking], k[walking], walking]
        k, f = k.copy(), f.copy()
        f[walking] -= step != 1
        up = walking[step != 2]
        k[up] -= 1
        last[k[up], up] = f[up]
