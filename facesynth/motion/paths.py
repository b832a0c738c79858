"""The cheapest path through candidates whose costs are all given."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def cheapest_path(targets: NDArray[np.float64], steps: NDArray[np.float64]) -> tuple[NDArray[np.int64], float]:
    """Path [T] of least cost, and that cost; ties go to the first candidate.

    targets: [T, K] cost of each candidate at each position. steps: [T - 1, K next, K previous] cost of going on.
    """
    phi, origins = targets[0], []
    for target, step in zip(targets[1:], steps, strict=True):
        total = step + phi
        origins.append(total.argmin(axis=1))
        phi = total.min(axis=1) + target
    path = [int(phi.argmin())]
    for origin in reversed(origins):
        path.append(int(origin[path[-1]]))
    return np.array(path[::-1], np.int64), float(phi.min())
