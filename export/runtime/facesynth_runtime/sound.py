"""Sound at another rate."""

from __future__ import annotations

from functools import lru_cache
from math import gcd
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth_runtime.errors import RuntimeInputError
from facesynth_runtime.tracks import checked_piece

BLOCK = 8192
"""Output samples computed at once."""
KAISER_BETA = 5.0


def resample(audio: NDArray[Any], rate: int, new_rate: int) -> NDArray[np.float32]:
    """The same sound [S] at another rate in Hz, band-limited: a polyphase filter of 20 periods of the lower rate."""
    rate, new_rate, audio = checked_hz(rate), checked_hz(new_rate), checked_piece(audio)
    if rate == new_rate:
        return audio
    common = gcd(rate, new_rate)
    up, down = new_rate // common, rate // common
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


def checked_hz(rate: Any) -> int:
    """A rate of sound."""
    if not isinstance(rate, int | float | np.number) or not (np.isfinite(rate) and rate > 0 and int(rate) == rate):
        raise RuntimeInputError(f"the sound has a rate of {rate} Hz; wanted a whole, positive number")
    return int(rate)


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
