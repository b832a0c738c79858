"""Sound to RASTA-PLP features as it comes in, and the time-warped distance of phones (Cao 2005, eq. 5)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..checks import checked_piece
from ..graphs import Graph

HOP, WINDOW = 160, 400
RATE = 16000
MOST_CELLS = 1 << 22
"""Numbers that a batch of warps may hold at once."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Ear:
    """`hear` sound at 16 kHz; `features` [G, P] grow, `finish` completes them with silence."""

    def __init__(self, graph: Graph, bands: int, parameters: int) -> None:
        self._graph = graph
        self._history, self._level = np.zeros((1, 4, bands)), np.zeros((1, bands))
        self._sound = np.zeros(WINDOW // 2, np.float32)
        """From the next frame's window on; before the sound there is silence."""
        self.samples = 0
        self._known: list[NDArray[np.float32]] = []
        self.count = 0
        self._empty = np.zeros((0, parameters), np.float32)

    @property
    def features(self) -> Floats:
        """[G, P] so far."""
        self._known = [np.concatenate([self._empty, *self._known])]
        return self._known[0].astype(np.float64)

    def hear(self, audio: ArrayLike) -> None:
        """More sound."""
        sound = checked_piece(audio)
        self._sound = np.concatenate([self._sound, sound])
        self.samples += len(sound)
        self._take((len(self._sound) - WINDOW) // HOP + 1)

    def finish(self) -> None:
        """After the end there is silence: frames up to the last that is centred within the sound."""
        self._sound = np.pad(self._sound, (0, WINDOW + HOP))
        self._take(1 + self.samples // HOP - self.count)

    def _take(self, count: int) -> None:
        if count <= 0:
            return
        windows = np.lib.stride_tricks.sliding_window_view(self._sound, WINDOW)[::HOP][:count]
        fresh = np.array(float(self.count == 0))
        state = {"history": self._history, "level": self._level, "fresh": fresh}
        cepstra, self._history, self._level = self._graph(windows=windows[None], **state)
        self._known.append(cepstra[0])
        self._sound, self.count = self._sound[count * HOP :], self.count + count


def audio_costs(wanted: Floats, features: Floats, starts: Ints, stops: Ints) -> Floats:
    """[n] mean over the frames of wanted [m, P] of the distance to the candidate's frames that warping matches with them."""
    costs, lengths = np.empty(len(starts)), stops - starts
    order, at = np.argsort(lengths, kind="stable"), 0
    while at < len(order):
        most = MOST_CELLS // (len(wanted) * int(lengths[order[-1]]) * wanted.shape[1])
        batch = order[at : at + max(1, most)]
        costs[batch] = _costs(wanted, features, starts[batch], lengths[batch])
        at += len(batch)
    return costs


def warp_path(wanted: Floats, heard: Floats) -> Floats:
    """[m] the place in heard [L, P], in frames, that warping matches with each frame of wanted [m, P]."""
    first, last = _matches(wanted, heard[None], np.array([len(heard)]))
    return (first[:, 0] + last[:, 0]) / 2


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


def _matches(wanted: Floats, heard: Floats, lengths: Ints) -> tuple[Ints, Ints]:
    """First and last frame [m, n] of each candidate heard [n, L, P] that each frame of wanted is matched with.

    Dynamic time-warping, anti-diagonal by anti-diagonal, all candidates together. Steps: 0 both advance, 1 only the
    input, 2 only the candidate.
    """
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
