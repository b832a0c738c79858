"""The opening of the mouth."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .errors import FacesynthError
from .motion import Motion


def lip_gap(motion: Motion) -> NDArray[np.float32]:
    """Opening of the inner lips [T] in the layout's unit: height of the upper over the lower point, mean over the pairs.

    NaN in frames in which a point is missing. FacesynthError where the layout has no lip pairs, or no points at all.
    """
    layout = motion.layout
    if layout.dimension < 2 or not layout.lip_pairs:
        raise FacesynthError(
            f"the layout ({layout.kind}) has no lip_pairs, so it has no lip gap; name the points on the inner lips"
        )
    upper, lower = np.array(layout.lip_pairs).T
    heights = motion.points[..., 1]
    return (heights[:, upper] - heights[:, lower]).mean(axis=1)
