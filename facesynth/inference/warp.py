"""Stretching a piece of motion to another number of frames."""

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray


def time_warp(frames: NDArray[Any], count: int) -> NDArray[Any]:
    """Frames [L, ...] resampled linearly to [count, ...], first and last frame kept.

    A single frame is repeated; asking for one frame of many gives the middle one.
    """
    length = len(frames)
    if count == length:
        return frames.copy()
    at = np.array([(length - 1) / 2]) if count == 1 else np.linspace(0, length - 1, count)
    low = np.minimum(at.astype(np.int64), max(length - 2, 0))
    share = (at - low).reshape(-1, *[1] * (frames.ndim - 1)).astype(frames.dtype)
    return frames[low] * (1 - share) + frames[np.minimum(low + 1, length - 1)] * share


class Pieces(Protocol):
    """Nodes of any database: node n moves through `frames[starts[n] : starts[n] + lengths[n]]`."""

    @property
    def frames(self) -> NDArray[np.floating[Any]]:
        """[F, D]"""

    @property
    def starts(self) -> NDArray[np.int64]:
        """[N]"""

    @property
    def lengths(self) -> NDArray[np.int64]:
        """[N] in frames."""


def stretched(nodes: Pieces, which: NDArray[np.int64], count: int) -> NDArray[np.float64]:
    """[n, count, D] the motions of the nodes `which`, each as `time_warp` brings it to `count` frames."""
    lengths = nodes.lengths[which]
    share = np.array([0.5]) if count == 1 else np.linspace(0, 1, count)
    at = np.where(np.equal(lengths, count)[:, None], np.arange(count), (lengths - 1)[:, None] * share)
    low = np.minimum(at.astype(np.int64), np.maximum(lengths - 2, 0)[:, None])
    high = np.minimum(low + 1, (lengths - 1)[:, None])
    part, first = (at - low)[..., None], nodes.starts[which][:, None]
    return np.asarray(nodes.frames[first + low] * (1 - part) + nodes.frames[first + high] * part)
