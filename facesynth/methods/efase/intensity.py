"""Between neutral and full emotion (named as missing in Deng 2008)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from facesynth.methods.efase.nodes import Floats, Ints
from facesynth.motion.layout import Layout
from facesynth.speech.phones import BILABIALS

SMOOTH_S = 0.08
CLOSE_S = 0.03


def blend(neutral: Floats, expressive: Floats, intensity: Floats, bounds: Ints, fps: float) -> Floats:
    """`x_neutral + I(t) (x_emotion - x_neutral)`, frames [T, C], intensity [P] of each phone, smoothed over time."""
    share = gaussian_filter1d(np.repeat(intensity, np.diff(bounds)), SMOOTH_S * fps, mode="nearest")[:, None]
    return neutral + share * (expressive - neutral)


def close_lips(
    frames: Floats, sources: tuple[Floats, Floats], layout: Layout, phones: tuple[str, ...], bounds: Ints, fps: float
) -> Floats:
    """Shut p, b, m again after a blend: both sources may close their lips, but not at the same moment.

    The inner-lip gap at each closure is brought down to the wider of the sources' own smallest gaps;
    both lips move half of the way, fading over 30 ms.
    """
    if not layout.lip_pairs or layout.kind == "curves":
        return frames
    upper, lower = np.array(layout.lip_pairs).T
    out = frames.copy()
    points = layout.points(out)
    gaps = [_gap(layout.points(source), upper, lower) for source in sources]
    now = _gap(points, upper, lower)
    at = np.arange(len(frames))
    push = np.zeros(len(frames))
    for phone, start, stop in zip(phones, bounds[:-1], bounds[1:], strict=True):
        if phone in BILABIALS and stop > start:
            target = max(gap[start:stop].min() for gap in gaps)
            k = start + int(now[start:stop].argmin())
            excess = max(now[k] - target, 0.0)
            push = np.maximum(push, excess * np.exp(-0.5 * ((at - k) / (CLOSE_S * fps)) ** 2))
    points[:, upper, 1] -= push[:, None] / 2
    points[:, lower, 1] += push[:, None] / 2
    return out


def _gap(points: NDArray[np.float64], upper: Ints, lower: Ints) -> Floats:
    return (points[:, upper, 1] - points[:, lower, 1]).mean(axis=1)
