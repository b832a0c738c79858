"""Sound of several channels, mixed to one as it is read, so that the others are never held in memory."""

from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.long_arrays import Growing, joined

CANCELLED = 0.005
"""A mean of channels with less than this share of the loudest one's energy: they undo each other (a cable with swapped poles)."""

Floats = NDArray[np.float32]


def one_channel(read: Callable[[], Iterable[Floats]]) -> Floats:
    """The mean [S] of the channels of the blocks [n, N] that `read` gives; the loudest channel where they cancel.

    `read` is called again for that, which is rare.
    """
    parts = Growing()
    mixed, energies = 0.0, np.zeros(1)
    for block in read():
        mean = block.mean(axis=1, dtype=np.float64)
        mixed += float(mean @ mean)
        energies = energies + np.einsum("sn,sn->n", block, block, dtype=np.float64)
        parts.add(mean)
    if mixed >= CANCELLED * energies.max():
        return parts.whole()
    loudest = int(energies.argmax())
    return joined(block[:, loudest] for block in read())
