"""Stretching a piece of motion to another number of frames."""

from __future__ import annotations

from typing import Any

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
