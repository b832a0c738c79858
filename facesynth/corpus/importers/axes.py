"""Which of a file's axes run to the performer's left, up, and out of the face, by what its markers are called."""

import re
from collections.abc import Sequence
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from facesynth.motion.point_groups import guess_groups

HIGH, LOW = ("forehead", "brows", "nose", "eyelids"), ("jaw", "lower_lip")
CLEAR = 0.8
"""Cosine between a direction of the face and an axis from which the axis is meant."""
_LEFT = re.compile(r"^l(?=[A-Z_.\- ]|eft)|left|Left|LEFT|[_.\- ][lL](eft)?\d*$|^L(?=[A-Z])|[a-z]L\d*$|_l\d+$")
_RIGHT = re.compile(r"^r(?=[A-Z_.\- ]|ight)|right|Right|RIGHT|[_.\- ][rR](ight)?\d*$|^R(?=[A-Z])|[a-z]R\d*$|_r\d+$")


def axes_by_names(names: Sequence[str], points: NDArray[np.float64]) -> str:
    """Axes such as `x,z,-y` of points [T, K, 3]; empty where they are ours already, or the names do not tell."""
    groups = guess_groups(names).groups
    if not np.isfinite(points).all(axis=2).any(axis=0).all():
        return ""
    shape = np.nanmedian(points, axis=0)
    high, low = ([k for group in wanted for k in groups.get(group, ())] for wanted in (HIGH, LOW))
    left, right = ([k for k, name in enumerate(names) if side.search(name)] for side in (_LEFT, _RIGHT))
    if not (high and low) or min(len(left), len(right)) < 2:
        return ""
    up = shape[high].mean(axis=0) - shape[low].mean(axis=0)
    across = shape[left].mean(axis=0) - shape[right].mean(axis=0)
    across, up = (vector / max(float(np.linalg.norm(vector)), 1e-9) for vector in (across, up))
    best = max(_turns(), key=lambda turn: float(turn[0] @ across + turn[1] @ up))
    if min(best[0] @ across, best[1] @ up) < CLEAR or np.array_equal(best, np.eye(3)):
        return ""
    return ",".join(("-" if row.sum() < 0 else "") + "xyz"[int(np.flatnonzero(row)[0])] for row in best)


def _turns() -> list[NDArray[np.float64]]:
    """The 24 rotations that lay axes on axes."""
    matrices = [
        np.eye(3)[list(places)] * np.array(signs)[:, None]
        for places in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
    ]
    return [matrix for matrix in matrices if np.linalg.det(matrix) > 0]
