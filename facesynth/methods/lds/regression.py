"""Least squares on tall matrices that are never held as a whole."""

from collections.abc import Iterable

import numpy as np
from scipy.linalg import qr

from facesynth.methods.lds.system import Array

GATHERED = 4
"""Blocks are gathered until there are so many rows for each column: short ones would be mostly factored in vain."""


def triangle(blocks: Iterable[Array]) -> Array:
    """R of the QR decomposition of row blocks [rows, columns] stacked: the root of their Gram matrix, to full precision."""
    waiting: list[Array] = []
    for block in blocks:
        waiting.append(block)
        if sum(map(len, waiting)) >= GATHERED * block.shape[1]:
            waiting = [_r(np.vstack(waiting))]
    return _r(np.vstack(waiting))


def _r(rows: Array) -> Array:
    return qr(rows, mode="r", check_finite=False)[0][: rows.shape[1]]


def solve(r: Array, unknowns: int) -> Array:
    """The least-squares solution [unknowns, targets] from `triangle` of rows [regressors | targets].

    Directions that the regressors hardly excite (below 1e-10 of the strongest) get zero.
    """
    return np.linalg.lstsq(r[:unknowns, :unknowns], r[:unknowns, unknowns:], rcond=1e-10)[0]
