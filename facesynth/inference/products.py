"""Matrix products on one thread."""

import numpy as np
from numpy.typing import NDArray

MOST_MULTIPLICATIONS = 1 << 18
"""Multiplications in one call: above, numpy's BLAS starts threads, which spin, cost more than they gain at these sizes, and
are not what was asked for with `threads`."""


def product(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """[m, n] a [m, k] @ b [k, n], a few rows at a time."""
    rows = max(1, MOST_MULTIPLICATIONS // max(b.size, 1))
    if len(a) <= rows:
        return a @ b
    b, out = np.ascontiguousarray(b), np.empty((len(a), b.shape[1]))
    for start in range(0, len(a), rows):
        np.matmul(a[start : start + rows], b, out=out[start : start + rows])
    return out
