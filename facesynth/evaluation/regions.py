"""Which points of a layout are the lips and which the upper face: said once, for every metric."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from facesynth.evaluation.pair import UnavailableError
from facesynth.inference.layout import Layout


def lip_points(layout: Layout) -> NDArray[np.int64]:
    """Indices of `lips_inner` and `lips_outer` where the layout has either, of `mouth` otherwise."""
    return _first_present(layout, ("lips_inner", "lips_outer"), "mouth")


def upper_face_points(layout: Layout) -> NDArray[np.int64]:
    """Indices of `upper_face` where the layout has it, of `forehead`, `brows` and `eyelids` otherwise."""
    if "upper_face" in layout.groups:
        return layout.group("upper_face")
    return _first_present(layout, ("forehead", "brows", "eyelids"), "upper_face")


def _first_present(layout: Layout, wanted: Sequence[str], fallback: str) -> NDArray[np.int64]:
    names = [name for name in wanted if name in layout.groups] or [fallback]
    if names == [fallback] and fallback not in layout.groups:
        raise UnavailableError(f"the layout has no group {', '.join(wanted)} or {fallback}")
    return np.unique(np.concatenate([layout.group(name) for name in names]))
