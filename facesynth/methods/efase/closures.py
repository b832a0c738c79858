"""Lips that were shut in the recording are shut in what is made of it."""

from __future__ import annotations

import numpy as np

from facesynth.inference.layout import Layout
from facesynth.methods.efase.nodes import Floats, Ints

CLOSE_S = 0.03
"""How fast a correction fades."""


def has_lips(layout: Layout) -> bool:
    """Whether the gap between the lips can be read off the layout's points."""
    return bool(layout.lip_pairs) and layout.kind != "curves"


def gap(frames: Floats, layout: Layout) -> Floats:
    """[T] mean height of the upper over the lower inner lip."""
    upper, lower = np.array(layout.lip_pairs).T
    points = layout.points(frames)
    return (points[:, upper, 1] - points[:, lower, 1]).mean(axis=1)


def close_lips(frames: Floats, wanted: Floats, layout: Layout, bounds: Ints, fps: float) -> Floats:
    """Bring the smallest gap of each phone down to `wanted` [P] (NaN: leave it).

    Stretching, smoothing and blending all widen a closure a little. Both lips move half of the way,
    fading over 30 ms.
    """
    out = frames.copy()
    now, at = gap(out, layout), np.arange(len(frames))
    push = np.zeros(len(frames))
    for target, start, stop in zip(wanted, bounds[:-1], bounds[1:], strict=True):
        if np.isfinite(target) and stop > start:
            k = start + int(now[start:stop].argmin())
            excess = max(now[k] - target, 0.0)
            push = np.maximum(push, excess * np.exp(-0.5 * ((at - k) / (CLOSE_S * fps)) ** 2))
    upper, lower = np.array(layout.lip_pairs).T
    points = layout.points(out)
    points[:, upper, 1] -= push[:, None] / 2
    points[:, lower, 1] += push[:, None] / 2
    return out
