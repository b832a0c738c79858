"""A long sound cut where it is quietest."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

PIECE_S = 12.0
"""About the length of a piece."""
_BLOCK_S = 0.05


def quiet_pieces(audio: NDArray[np.float32], rate: int) -> list[tuple[int, int]]:
    """First sample and sample after the last of pieces of PIECE_S, give or take a third, cut where it is quietest."""
    block = round(_BLOCK_S * rate)
    count = len(audio) // block
    level = np.asarray(audio[: count * block], np.float64).reshape(count, block).std(axis=1)
    level = np.convolve(level, np.ones(5) / 5, mode="same")
    length, slack = round(PIECE_S / _BLOCK_S), round(PIECE_S / _BLOCK_S / 3)
    cuts = [0]
    while count - cuts[-1] > length + slack:
        first = cuts[-1] + length - slack
        cuts.append(first + int(level[first : first + 2 * slack].argmin()))
    edges = [*(cut * block + block // 2 * (cut > 0) for cut in cuts), len(audio)]
    return list(pairwise(edges))


def quietest_s(audio: NDArray[np.float32], rate: int, from_s: float, to_s: float) -> float:
    """The middle of the quietest stretch of a sound [S] between two times, seconds."""
    if to_s - from_s < 2 * _BLOCK_S:
        return (from_s + to_s) / 2
    step = round(_BLOCK_S * rate / 5)
    piece = audio[max(0, round(from_s * rate)) : round(to_s * rate)]
    count = len(piece) // step
    power = np.square(np.asarray(piece[: count * step], np.float64).reshape(count, step)).mean(axis=1)
    level = np.convolve(power, np.ones(5) / 5, mode="valid")
    quiet = np.flatnonzero(level <= 2 * level.min() + 1e-12)
    longest = max(np.split(quiet, np.flatnonzero(np.diff(quiet) > 1) + 1), key=len)
    return from_s + ((longest[0] + longest[-1]) / 2 + 2.5) * step / rate
