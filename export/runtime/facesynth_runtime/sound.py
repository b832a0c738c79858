"""Sound at another rate."""

from __future__ import annotations

from functools import lru_cache
from math import gcd
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth_runtime.errors import RuntimeInputError

BLOCK = 8192
"""Output samples computed at once."""
KAISER_BETA = 5.0


def resample(audio: NDArray[Any], rate: int, new_rate: int) -> NDArray[np.float32]:
    """The same sound [S] at another rate in Hz, band-limited: a polyphase filter of 20 periods of the lower rate."""
    if not (rate > 0 and new_rate > 0 and int(rate) == rate and int(new_rate) == new_rate):
        raise RuntimeInputError(f"sound has {rate} Hz and was asked for at {new_rate} Hz; wanted whole, positive rates")
    if rate == new_rate:
        return np.asarray(audio, np.float32)
    common = gcd(int(rate), int(new_rate))
    up, down = int(new_rate) // common, int(rate) // common
    table, reach = _phases(up, down)
    each = table.shape[1]
    count = -(-len(audio) * up // down)
    padded = np.pad(np.asarray(audio, np.float64), (each, each))
    windows = np.lib.stride_tricks.sliding_window_view(padded, each)
    out = np.empty(count, np.float32)
    for start in range(0, count, BLOCK):
        k = np.arange(start, min(start + BLOCK, count), dtype=np.int64)
        first = -(-(k * down - reach) // up)
        phase = first * up - (k * down - reach)
        out[k] = np.einsum("kn,kn->k", table[phase], windows[np.minimum(first + each, len(windows) - 1)])
    return out


@lru_cache(maxsize=8)
def _phases(up: int, down: int) -> tuple[NDArray[np.float64], int]:
    """[up, n] taps that the n input samples around an output sample are weighted with, by where it lies between them.

    Taken from a Kaiser-windowed sinc of gain `up`, whose half length, counted at the common rate, comes beside them.
    """
    slower = max(up, down)
    reach = 10 * slower
    taps = np.sinc(np.arange(-reach, reach + 1) / slower) * np.kaiser(2 * reach + 1, KAISER_BETA)
    taps *= up / taps.sum()
    places = 2 * reach - np.arange(up)[:, None] - up * np.arange(2 * reach // up + 2)
    return np.where(places >= 0, taps[np.maximum(places, 0)], 0.0), reach
