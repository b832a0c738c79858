"""Dynamic time-warping of audio features, over all candidates of a phone at once (Cao 2005, eq. 5)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .graph import Floats, Ints

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
# Steps: 0 both advance, 1 only the input (the candidate holds), 2 only the candidate; of equal ones the first.
def _matches(wanted: Floats, heard: Floats, lengths: Ints) -> tuple[Ints, Ints]:
    """First and last frame [m, n] of each candidate heard [n, L, P] that each frame of wanted is matched with."""
    m, (n, length) = len(wanted), heard.shape[:2]
    apart = np.sqrt(np.square(wanted[:, None, None] - heard.transpose(1, 0, 2)).sum(axis=3))  # [m, L, n]
    total = np.full((m + 1, length + 1, n), np.inf)
    steps = np.zeros((m, length, n), np.uint8)
    total[1, 1] = apart[0, 0]
    for diagonal in range(1, m + length - 1):
        k = np.arange(max(0, diagonal - length + 1), min(diagonal, m - 1) + 1)
        f = diagonal - k
        both, held, passed = total[k, f], total[k, f + 1], total[k + 1, f]
        best, step = both, np.zeros(both.shape, np.uint8)
        for cost, number in ((held, 1), (passed, 2)):
            better = cost < best
            best, step = np.where(better, cost, best), np.where(better, np.uint8(number), step)
        total[k + 1, f + 1], steps[k, f] = best + apart[k, f], step
    return _traced(steps, lengths)


def _traced(steps: NDArray[np.uint8], lengths: Ints) -> tuple[Ints, Ints]:
    """All ways back from their ends together."""
    m, _, n = steps.shape
    row, k, f = np.arange(n), np.full(n, m - 1), lengths - 1
    first, last = np.zeros((2, m, n), np.int64)
    last[k, row] = f
    while True:
        first[k, row] = f
        walking = np.flatnonzero((k > 0) | (f > 0))
        if not len(walking):
            return first, last
        step = steps[k[walking], f[walking], walking]
        k, f = k.copy(), f.copy()
        f[walking] -= step != 1
        up = walking[step != 2]
        k[up] -= 1
        last[k[up], up] = f[up]
