"""Sound at another rate."""

from __future__ import annotations

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
    taps, reach = _low_pass(up, down)
    count = -(-len(audio) * up // down)
    each = 2 * (reach // up) + 3  # input samples that one output sample may see
    padded = np.pad(np.asarray(audio, np.float64), (each, each))
    out = np.empty(count, np.float32)
    for start in range(0, count, BLOCK):
        k = np.arange(start, min(start + BLOCK, count), dtype=np.int64)
        first = -(-(k * down - reach) // up)
        inputs = first[:, None] + np.arange(each)
        places = reach + k[:, None] * down - inputs * up
        weights = np.where((places >= 0) & (places < len(taps)), taps[np.clip(places, 0, len(taps) - 1)], 0.0)
        inside = np.clip(inputs + each, 0, len(padded) - 1)
        out[k] = (weights * padded[inside]).sum(axis=1)
    return out


def _low_pass(up: int, down: int) -> tuple[NDArray[np.float64], int]:
    """A Kaiser-windowed sinc of gain `up`, and its half length."""
    slower = max(up, down)
    reach = 10 * slower
    at = np.arange(-reach, reach + 1)
    taps = np.sinc(at / slower) * np.kaiser(2 * reach + 1, KAISER_BETA)
    return taps * (up / taps.sum()), reach
