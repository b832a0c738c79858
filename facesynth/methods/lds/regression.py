"""Least squares on tall matrices that are never held as a whole."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy.linalg import qr

from facesynth.methods.lds.system import Array


def triangle(blocks: Iterable[Array]) -> Array:
    """R of the QR decomposition of row blocks [rows, columns] stacked: the root of their Gram matrix, to full precision."""
    remaining = iter(blocks)
    r = _r(next(remaining))
    for block in remaining:
        r = _r(np.vstack([r, block]))
    return r


def _r(rows: Array) -> Array:
    return qr(rows, mode="r", check_finite=False)[0][: rows.shape[1]]


def solve(r: Array, unknowns: int) -> Array:
    """The least-squares solution [unknowns, targets] from `triangle` of rows [regressors | targets].

    Directions that the regressors hardly excite (below 1e-10 of the strongest) get zero.
    """
    return np.linalg.lstsq(r[:unknowns, :unknowns], r[:unknowns, unknowns:], rcond=1e-10)[0]
