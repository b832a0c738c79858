"""Filters and splines over time: what scipy would give, in numpy. Signals are [T, C], time first."""

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Floats, Ints
from .long_arrays import Growing, by_columns, by_overlapping_blocks, let_go, row_blocks, zeros

PASS, ORDER = 0.9, 6
"""Movement up to this share of the new rate's Nyquist frequency is kept when a rate falls, by a Butterworth filter."""
QUICK_S = 0.08
"""Standard deviation of the smoothing that parts slow movement from quick."""
ROUGH_S = 0.02
"""What is quicker than this is joints and the noise of sensors: it is smoothed away, not raised."""


def gaussian(signal: Floats, sigma: float) -> Floats:
    """A signal [T] or [T, C] smoothed with a Gaussian of `sigma` frames, cut at four of them; the ends are held."""
    if signal.ndim > 1:
        return np.stack([gaussian(column, sigma) for column in signal.T], axis=1)
    reach = int(4 * sigma + 0.5)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    return np.convolve(np.pad(signal, reach, mode="edge"), weights / weights.sum(), mode="valid")


def sharpen(frames: Floats, share: float, fps: float) -> Floats:
    """`y + share (y - slow y)`, y the frames [T, D] without roughness; share 0 leaves them as they are.

    Nothing new is made up, and a pose that is held stays. Raised as well, the roughness would double the jerk of
    natural motion; this way both the energy and the jerk of a mean come near those of recordings.
    """
    if share == 0:
        return frames
    reach = int(4 * (ROUGH_S + QUICK_S) * fps) + 2
    return by_overlapping_blocks(lambda some: _sharpened(some, share, fps), frames, reach)


def _sharpened(frames: Floats, share: float, fps: float) -> Floats:
    smooth = without_roughness(frames, fps)
    return smooth + share * (smooth - gaussian(smooth, QUICK_S * fps))


def without_roughness(frames: Floats, fps: float) -> Floats:
    """Frames [T, C] without what is quicker than ROUGH_S."""
    return gaussian(frames, ROUGH_S * fps)


def butterworth(order: int, cutoff: ArrayLike) -> Floats:
    """[order // 2, 3, …] (gain, a1, a2) of the sections of a low-pass of even order; cut-off in 0..1 of half the rate.

    Section: g (1 + z⁻¹)² / (1 + a1 z⁻¹ + a2 z⁻²), of gain 1 at rest. `cutoff` may be an array, one for each channel.
    """
    warped = np.tan(np.pi * np.asarray(cutoff, np.float64) / 2)
    sections = []
    for k in range(order // 2):
        pole = np.exp(1j * np.pi * (2 * k + order + 1) / (2 * order)) * warped
        z = (1 + pole) / (1 - pole)
        a1, a2 = -2 * z.real, np.abs(z) ** 2
        sections.append(np.stack([(1 + a1 + a2) / 4, a1, a2]))
    return np.stack(sections)


# A signal is continued oddly at both ends, the filter starts in the steady state of its first value, runs forth and then
# back. Channels may be continued by different lengths: before its own continuation a channel is held constant, on which a
# filter in its steady state stays there, so that all channels run together.
def forth_and_back(sections: Floats, signal: Floats, reach: ArrayLike) -> Floats:
    """Zero-phase filtering of [T, C]; `reach` frames, one number or [C], are added at each end and taken off again."""
    count, channels = signal.shape
    own = np.broadcast_to(np.asarray(reach, np.int64), (channels,))
    most = int(own.max())
    before = np.clip(np.arange(most, 0, -1)[:, None], 1, np.maximum(own, 1))
    head = np.where(own > 0, 2 * signal[0] - np.take_along_axis(signal, np.minimum(before, count - 1), axis=0), signal[0])
    behind = count - 1 - np.clip(np.arange(1, most + 1)[:, None], 1, np.maximum(own, 1))
    tail = np.where(own > 0, 2 * signal[-1] - np.take_along_axis(signal, np.maximum(behind, 0), axis=0), signal[-1])
    run, there = _Cascade(sections), Growing(np.float64)
    for piece in (head[:most], *(signal[rows] for rows in row_blocks(signal)), tail[:most]):
        there.add(run.on(piece))
    return _back(sections, there.whole(), own)[most : most + count]


def _back(sections: Floats, there: Floats, own: Ints) -> Floats:
    """What ran forth [most + T + most, C] runs back, each channel from where its own continuation [C] ends."""
    last = len(there) - int(own.max()) + own - 1
    end = there[last, np.arange(there.shape[1])]
    run, out = _Cascade(sections), zeros(there.shape)
    for rows in reversed([*row_blocks(there)]):
        held = np.where(np.arange(rows.start, rows.stop)[:, None] > last, end, there[rows])
        out[rows] = run.on(held[::-1])[::-1]
        let_go(there)
        let_go(out)
    return out


class _Cascade:
    """The sections in a row, over a signal that comes in pieces [n, C], started in the steady state of the first frame."""

    def __init__(self, sections: Floats) -> None:
        self._sections = sections
        self._rows: list[tuple[Floats, Floats, Floats]] = []
        self._s0: list[Floats] = []
        self._s1: list[Floats] = []

    def _start(self, first: Floats) -> None:
        shape = (len(self._sections), len(first))
        g, a1, a2 = (np.broadcast_to(self._sections[:, k].reshape(len(self._sections), -1), shape) for k in range(3))
        self._rows = list(zip(g, a1, a2, strict=True))
        self._s0, self._s1 = list((1 - g) * first), list((g - a2) * first)

    def on(self, signal: Floats) -> Floats:
        """The next frames."""
        if len(signal) and not self._rows:
            self._start(signal[0])
        out, s0, s1 = np.empty_like(signal), self._s0, self._s1
        for t, x in enumerate(signal):
            value = x
            for k, (gain, b1, b2) in enumerate(self._rows):
                scaled = gain * value
                y = scaled + s0[k]
                s0[k] = 2 * scaled - b1 * y + s1[k]
                s1[k] = scaled - b2 * y
                value = y
            out[t] = value
        return out


def spline_at(signal: Floats, at: Floats) -> Floats:
    """The cubic spline (not-a-knot) through frames [T, C], read at places [n] in 0..T-1."""
    count = len(signal)
    if count < 2:
        return np.repeat(signal, len(at), axis=0)
    bends = _bends(signal)
    low = np.clip(np.floor(at).astype(np.int64), 0, count - 2)
    b = (at - low)[:, None]
    a = 1 - b
    curved = ((a**3 - a) * bends[low] + (b**3 - b) * bends[low + 1]) / 6
    return a * signal[low] + b * signal[low + 1] + curved


def _bends(signal: Floats) -> Floats:
    """Second derivatives [T, C] of the spline: M(i-1) + 4 M(i) + M(i+1) = 6 (y(i-1) - 2 y(i) + y(i+1)).

    With evenly spaced knots, not-a-knot makes the first and the last of these equations 6 M = right side.
    """
    count = len(signal)
    bends = np.zeros_like(signal)
    if count < 3:
        return bends
    right = 6 * np.diff(signal, n=2, axis=0)  # [T - 2]
    bends[1], bends[-2] = right[0] / 6, right[-1] / 6
    inner = right[1:-1].copy()  # equations of M(2) … M(T - 3)
    if len(inner):
        inner[0] -= bends[1]
        inner[-1] -= bends[-2]
        ratios = np.empty(len(inner))
        for k in range(len(inner)):
            ratios[k] = 1 / (4 - (ratios[k - 1] if k else 0.0))
            inner[k] = (inner[k] - (inner[k - 1] if k else 0.0)) * ratios[k]
        for k in range(len(inner) - 2, -1, -1):
            inner[k] -= ratios[k] * inner[k + 1]
        bends[2:-2] = inner
    bends[0] = 2 * bends[1] - bends[2] if count > 3 else bends[1]
    bends[-1] = 2 * bends[-2] - bends[-3] if count > 3 else bends[1]
    return bends


def cubic_at(signal: Floats, at: Floats) -> Floats:
    """Frames [T, C] read at places [n] in 0..T-1 by the cubic of the four frames around each (Catmull-Rom); ends are held.

    Nearly as smooth as `spline_at`, and a place is known when two frames after it are: a stream gives what the whole gives.
    """
    low = np.floor(at + 1e-9).astype(np.int64)
    t = np.clip(at - low, 0, 1)[:, None]
    a, b, c, d = (signal[np.clip(low + step, 0, len(signal) - 1)] for step in (-1, 0, 1, 2))
    return np.asarray(b + 0.5 * t * (c - a + t * (2 * a - 5 * b + 4 * c - d + t * (3 * (b - c) + d - a))))


def at_rate(frames: Floats, fps: float, new_fps: float, at: Floats) -> Floats:
    """Frames [T, C] read at places [n] in old frames; movement that the new rate cannot carry is filtered out first."""
    return by_columns(lambda some: _at_rate(some, fps, new_fps, at), frames, len(at))


def _at_rate(frames: Floats, fps: float, new_fps: float, at: Floats) -> Floats:
    if falls(fps, new_fps) and len(frames) > 1:
        frames = forth_and_back(butterworth(ORDER, PASS * new_fps / fps), frames, reach_of(len(frames), fps, new_fps))
    return spline_at(frames, at)


def falls(fps: float, new_fps: float) -> bool:
    """Whether a change of rate takes out what the new one cannot carry: nothing where the rate hardly falls."""
    return new_fps < PASS * fps


def reach_of(count: int, fps: float, new_fps: float) -> int:
    """Frames by which `count` frames are continued at each end while they are filtered for a lower rate."""
    return min(count - 1, round(3 * fps / new_fps) + 18)
