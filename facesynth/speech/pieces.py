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
