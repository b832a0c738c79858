"""Dynamic time-warping of audio features, over all candidates of a phone at once."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True, fastmath={"reassoc", "contract"})
def _accumulate(wanted, heard, total, steps):  # type: ignore[no-untyped-def]
    """Fill total [m, L] with the least accumulated distance, steps with where it came from; a monotone DTW.

    Steps: 0 both advance, 1 only the input advances (the candidate holds), 2 only the candidate advances.
    """
    m, length, width = wanted.shape[0], heard.shape[0], wanted.shape[1]
    for k in range(m):
        for f in range(length):
            distance = 0.0
            for c in range(width):
                difference = wanted[k, c] - heard[f, c]
                distance += difference * difference
            best, step = 0.0, 0
            if k > 0 and f > 0:
                best, step = total[k - 1, f - 1], 0
                if total[k - 1, f] < best:
                    best, step = total[k - 1, f], 1
                if total[k, f - 1] < best:
                    best, step = total[k, f - 1], 2
            elif k > 0:
                best, step = total[k - 1, f], 1
            elif f > 0:
                best, step = total[k, f - 1], 2
            total[k, f] = best + np.sqrt(distance)
            steps[k, f] = step


@njit(cache=True)
def _trace(steps, m, length, first, last):  # type: ignore[no-untyped-def]
    """Walk back from the end: the candidate frames [first, last] that each input frame is matched with."""
    k, f = m - 1, length - 1
    last[k] = f
    while True:
        first[k] = f
        if k == 0 and f == 0:
            return
        step = steps[k, f]
        if step != 1:
            f -= 1
        if step != 2:
            k -= 1
            last[k] = f


@njit(cache=True)
def _costs(wanted, features, starts, stops):  # type: ignore[no-untyped-def]
    m = wanted.shape[0]
    costs = np.empty(len(starts))
    for n in range(len(starts)):
        length = stops[n] - starts[n]
        total, steps = np.empty((m, length)), np.empty((m, length), np.uint8)
        first, last = np.empty(m, np.int64), np.empty(m, np.int64)
        heard = features[starts[n] : stops[n]]
        _accumulate(wanted, heard, total, steps)
        _trace(steps, m, length, first, last)
        cost = 0.0
        for k in range(m):
            distance = 0.0
            for c in range(wanted.shape[1]):
                mean = 0.0
                for f in range(first[k], last[k] + 1):
                    mean += heard[f, c]
                difference = wanted[k, c] - mean / (last[k] - first[k] + 1)
                distance += difference * difference
            cost += np.sqrt(distance)
        costs[n] = cost / m
    return costs


def audio_costs(
    wanted: NDArray[np.float64], features: NDArray[np.float64], starts: NDArray[np.int64], stops: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Cao 2005, eq. 5, for many candidates: mean over input frames of ‖wanted(k) - warped candidate(k)‖.

    wanted: [m, P] features of one phone of the input. Candidate n has the frames `features[starts[n]:stops[n]]`
    of features [G, P]. The warped candidate at k is the mean of the frames that DTW matched with k. Returns [n].
    """
    return _costs(*(np.ascontiguousarray(a) for a in (wanted, features, starts, stops)))


def warp_path(wanted: NDArray[np.float64], candidate: NDArray[np.float64]) -> NDArray[np.float64]:
    """[m] the place in candidate [L, P], in frames 0..L-1, that DTW matches with each frame of wanted [m, P]."""
    m, length = len(wanted), len(candidate)
    total, steps = np.empty((m, length)), np.empty((m, length), np.uint8)
    first, last = np.empty(m, np.int64), np.empty(m, np.int64)
    _accumulate(np.ascontiguousarray(wanted), np.ascontiguousarray(candidate), total, steps)
    _trace(steps, m, length, first, last)
    return (first + last) / 2
