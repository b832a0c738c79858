"""Sound at another rate."""

from functools import lru_cache
from math import gcd
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .checks import checked_piece, require_open
from .errors import FacesynthError
from .long_arrays import Growing, let_go

BLOCK = 1 << 20
"""Output samples that are computed at once."""
FEW = 4
"""Output samples of a kind, under which they are gathered."""
KAISER_BETA = 5.0
REACH = 10
"""Half length of the filter in periods of the lower rate."""


def resampled_length(samples: int, rate: int, new_rate: int) -> int:
    """How many samples `resample` makes of so many."""
    return -(-samples * new_rate // rate)


def resample(audio: NDArray[Any], rate: int, new_rate: int) -> NDArray[np.float32]:
    """The same sound [S] at another rate in Hz, band-limited: a polyphase filter of 20 periods of the lower rate."""
    rate, new_rate, audio = checked_hz(rate), checked_hz(new_rate), checked_piece(audio)
    if rate == new_rate:
        return audio
    count, around = resampled_length(len(audio), rate, new_rate), REACH * max(1, -(-rate // new_rate)) + 2
    parts = Growing()
    for start in range(0, max(1, count), BLOCK):  # sums in float64 of the whole would be four times as large as the sound
        stop = min(start + BLOCK, count)
        first, last = max(0, start * rate // new_rate - around), stop * rate // new_rate + around
        parts.add(_resampled(audio[first:last], first, start, stop, rate, new_rate))
        let_go(audio)
    return parts.whole()


class Resampler:
    """The same for sound in pieces: what `push` and `finish` give is, put together, `resample` of the whole."""

    def __init__(self, rate: int, new_rate: int) -> None:
        self.rate, self.new_rate = checked_hz(rate), checked_hz(new_rate)
        self._heard = np.zeros(0, np.float32)
        self._first = self._given = 0
        """Which sample `heard` begins with; how many samples were given out."""
        self._ended = False

    @property
    def look_ahead_s(self) -> float:
        """A sample is given out when the sound up to this after it is known, seconds."""
        return 0.0 if self.rate == self.new_rate else 10 / min(self.rate, self.new_rate)

    def push(self, audio: ArrayLike) -> NDArray[np.float32]:
        """More sound [S]; the samples [S'] that became final."""
        require_open(self._ended)
        piece = checked_piece(audio)
        if self.rate == self.new_rate:
            return piece
        self._heard = np.concatenate([self._heard, piece])
        common = gcd(self.rate, self.new_rate)
        up, down = self.new_rate // common, self.rate // common
        known = (self._first + len(self._heard) - 1) * up - REACH * max(up, down)
        return self._give(max(self._given, known // down))

    def finish(self) -> NDArray[np.float32]:
        """The samples that were held back: after the end there is silence."""
        require_open(self._ended)
        self._ended = True
        return self._give(-(-(self._first + len(self._heard)) * self.new_rate // self.rate))

    def _give(self, stop: int) -> NDArray[np.float32]:
        given = _resampled(self._heard, self._first, self._given, stop, self.rate, self.new_rate)
        self._given = max(self._given, stop)
        common = gcd(self.rate, self.new_rate)
        up, down = self.new_rate // common, self.rate // common
        needed = (self._given * down - REACH * max(up, down)) // up - 1
        kept = min(max(0, needed - self._first), len(self._heard))
        self._heard, self._first = self._heard[kept:], self._first + kept
        return given


# Output sample k is a sum over the input samples around k * down / up, weighted with taps that depend on where k lies between
# them: every `up`-th output has the same taps and lies `down` inputs further. Those go together, as windows of the input that
# are looked at and not copied; a short piece, with few of each kind, is gathered at once. Sums are the same, bit for bit.
def _resampled(audio: NDArray[Any], first: int, start: int, stop: int, rate: int, new_rate: int) -> NDArray[np.float32]:
    """Output samples start..stop of a sound whose samples from `first` on are given; around them there is silence."""
    common = gcd(rate, new_rate)
    up, down = new_rate // common, rate // common
    table, reach = _phases(up, down)
    each = table.shape[1]
    padded = np.pad(np.asarray(audio, np.float64), (each, each))
    windows = np.lib.stride_tricks.sliding_window_view(padded, each)
    places = np.arange(start, max(start, stop), dtype=np.int64) * down - reach
    begins = -(-places // up)
    phases, begins = begins * up - places, begins - first + each
    if len(places) < FEW * up:
        return np.einsum("kn,kn->k", table[phases], windows[begins]).astype(np.float32)
    out = np.empty(len(places), np.float32)
    for k in range(up):
        alike = out[k::up]
        alike[:] = np.einsum("kn,n->k", windows[begins[k] :: down][: len(alike)], table[phases[k]])
    return out


def checked_hz(rate: Any) -> int:
    """A rate of sound."""
    if not isinstance(rate, int | float | np.number) or not (np.isfinite(rate) and rate > 0 and int(rate) == rate):
        raise FacesynthError(f"the sound has a rate of {rate} Hz; wanted a whole, positive number")
    return int(rate)


@lru_cache(maxsize=8)
def _phases(up: int, down: int) -> tuple[NDArray[np.float64], int]:
    """[up, n] taps that the n input samples around an output sample are weighted with, by where it lies between them.

    Taken from a Kaiser-windowed sinc of gain `up`, whose half length, counted at the common rate, comes beside them.
    """
    slower = max(up, down)
    reach = REACH * slower
    taps = np.sinc(np.arange(-reach, reach + 1) / slower) * np.kaiser(2 * reach + 1, KAISER_BETA)
    taps *= up / taps.sum()
    places = 2 * reach - np.arange(up)[:, None] - up * np.arange(2 * reach // up + 2)
    return np.where(places >= 0, taps[np.maximum(places, 0)], 0.0), reach
