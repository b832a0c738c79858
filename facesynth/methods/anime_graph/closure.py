"""Lips that were shut stay shut when the rest of the face changes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from facesynth.motion.layout import Layout

SHUT_SHARE = 0.1
"""Lips count as shut up to this share of the way from the narrowest gap to a wide one …"""
OPEN_SHARE = 0.3
"""… and as open from this share on; between them they are held together less and less."""


def keep_shut(changed: NDArray[np.float64], before: NDArray[np.float64], layout: Layout) -> NDArray[np.float64]:
    """Frames [T, C] like `changed`, with the inner lips as near to each other as they were where they were shut `before`.

    Each pair of facing lip points gets back the distance vector that it had, half from above and half from below;
    the other points of a lip follow by the mean of its corrections. Layouts without lip pairs stay as they are.
    """
    if layout.dimension < 2 or not layout.lip_pairs:
        return changed
    upper, lower = np.array(layout.lip_pairs).T
    points, old = layout.points(changed.copy()), layout.points(before)
    shut = _shut(old[:, upper, 1] - old[:, lower, 1])[..., None]
    apart = (points[:, upper] - points[:, lower]) - (old[:, upper] - old[:, lower])
    correction = shut * apart / 2
    for group, own, sign in (("upper_lip", upper, -1), ("lower_lip", lower, 1)):
        others = np.setdiff1d(layout.group(group) if group in layout.groups else own, own)
        points[:, others] += sign * correction.mean(axis=1, keepdims=True)
        points[:, own] += sign * correction
    return points.reshape(changed.shape)


def _shut(gaps: NDArray[np.float64]) -> NDArray[np.float64]:
    """[T, pairs] 1 where the lips are shut, 0 where they are open."""
    narrow, wide = np.nanpercentile(gaps, [1, 95], axis=0)
    share = (gaps - narrow) / np.maximum(wide - narrow, 1e-6)
    return np.clip((OPEN_SHARE - share) / (OPEN_SHARE - SHUT_SHARE), 0.0, 1.0)
