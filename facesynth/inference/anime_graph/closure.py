"""Lips that close at p, b and m, and stay shut when the rest of the face changes."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ..layout import Layout

SHUT_SHARE, OPEN_SHARE = 0.25, 0.6
CLOSING_S, LONGEST_CLOSING_S = 0.04, 0.15

Floats = NDArray[np.float64]
Span = tuple[int, int]


def keep_shut(changed: Floats, before: Floats, layout: Layout) -> Floats:
    """Frames [T, C] like `changed`, with the inner lips as near to each other as they were where they were shut `before`."""
    if layout.dimension < 2 or not layout.lip_pairs:
        return changed
    upper, lower = np.array(layout.lip_pairs).T
    points, old = layout.points(changed.copy()), layout.points(before)
    gaps = old[:, upper, 1] - old[:, lower, 1]
    narrow, wide = np.nanpercentile(gaps, [1, 95], axis=0)
    share = (gaps - narrow) / np.maximum(wide - narrow, 1e-6)
    shut = np.clip((OPEN_SHARE - share) / (OPEN_SHARE - SHUT_SHARE), 0.0, 1.0)[..., None]
    apart = (points[:, upper] - points[:, lower]) - (old[:, upper] - old[:, lower])
    _bring_together(points, layout, shut * apart / 2)
    return points.reshape(changed.shape)


def close_at(frames: Floats, layout: Layout, spans: Iterable[Span], gap: float, fps: float) -> Floats:
    """Frames [T, C] whose lips come as near to each other as `gap` within each span of frames."""
    if layout.dimension < 2 or not layout.lip_pairs:
        return frames
    upper, lower = np.array(layout.lip_pairs).T
    points = layout.points(frames.copy())
    for start, stop in spans:
        heights = (points[start:stop, upper, 1] - points[start:stop, lower, 1]).mean(axis=1)
        if not len(heights) or heights.min() <= gap:
            continue
        middle, reach = start + int(heights.argmin()), closing_frames(start, stop, fps)
        near = np.arange(max(0, int(middle - reach)), min(len(points), int(middle + reach) + 1))
        amount = 0.5 + 0.5 * np.cos(np.pi * np.clip((near - middle) / reach, -1, 1))
        correction = np.zeros((len(near), len(upper), layout.dimension))
        correction[..., 1] = (amount * (heights.min() - gap))[:, None] / 2
        some = points[near]
        _bring_together(some, layout, correction)
        points[near] = some
    return points.reshape(frames.shape)


def closing_frames(start: int, stop: int, fps: float) -> float:
    """How many frames before and after its narrowest one a closure in a span touches."""
    return float(np.clip((stop - start) / 2, CLOSING_S * fps, LONGEST_CLOSING_S * fps)) + 1


def _bring_together(points: Floats, layout: Layout, correction: Floats) -> None:
    upper, lower = np.array(layout.lip_pairs).T
    for group, own, sign in (("upper_lip", upper, -1), ("lower_lip", lower, 1)):
        others = np.setdiff1d(np.array(layout.groups.get(group, own), np.int64), own)
        points[:, others] += sign * correction.mean(axis=1, keepdims=True)
        points[:, own] += sign * correction
