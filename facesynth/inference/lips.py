"""The opening of the mouth: the gap between the inner lips, and where p, b and m close it."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import FacesynthError
from .layout import Layout
from .long_arrays import by_blocks
from .motion import Motion
from .phones import BILABIALS
from .speech import PhoneTrack

Span = tuple[int, int]
"""First frame and one past the last."""


def has_lips(layout: Layout) -> bool:
    """Whether a layout says which points of the lips face each other."""
    return layout.dimension > 1 and bool(layout.lip_pairs)


def heights_between(points: NDArray[Any], pairs: ArrayLike) -> NDArray[Any]:
    """[..., P] height of the upper over the lower point of each pair [P, 2] among points [..., K, 2 or 3]; y is up."""
    upper, lower = np.asarray(pairs).T
    return points[..., upper, 1] - points[..., lower, 1]


def pair_gaps(frames: NDArray[Any], layout: Layout) -> NDArray[Any]:
    """[T, pairs] height of the upper over the lower point of each lip pair, in the layout's unit; see `has_lips`."""
    return heights_between(layout.points(frames), layout.lip_pairs)


def gap(frames: NDArray[Any], layout: Layout) -> NDArray[Any]:
    """[T] opening of the inner lips of frames [T, C]: mean of `pair_gaps`; NaN where a point is missing."""
    opening = by_blocks(lambda some: pair_gaps(some, layout).mean(axis=1), frames, np.result_type(frames, np.float32))
    return np.asarray(opening)


def lip_gap(motion: Motion) -> NDArray[np.float32]:
    """[T] `gap` of a motion; FacesynthError where its layout has no lip pairs, or no points at all."""
    layout = motion.layout
    if not has_lips(layout):
        raise FacesynthError(
            f"the layout ({layout.kind}) has no lip_pairs, so it has no lip gap; name the points on the inner lips"
        )
    return gap(motion.frames, layout)


def narrowest_gaps(frames: NDArray[Any], layout: Layout, spans: Iterable[Span]) -> list[float]:
    """The smallest opening in each span of frames [T, C] that has no missing samples; none for layouts without lips."""
    if not has_lips(layout):
        return []
    openings = [gap(frames[start:stop], layout) for start, stop in spans if stop > start]
    return [float(opening.min()) for opening in openings if np.isfinite(opening).all()]


def bilabial_spans(phones: PhoneTrack, fps: float) -> list[Span]:
    """The frames of each p, b and m; none at all (start = stop) of one that is too short for a frame."""
    bounds = phones.frame_bounds(fps).tolist()
    return [(a, b) for label, a, b in zip(phones.labels, bounds[:-1], bounds[1:], strict=True) if label in BILABIALS]
