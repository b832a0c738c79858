"""Between neutral and full emotion (named as missing in Deng 2008)."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from facesynth.methods.efase.nodes import Floats, Ints

SMOOTH_S = 0.08


def blend(neutral: Floats, expressive: Floats, intensity: Floats, bounds: Ints, fps: float) -> Floats:
    """`x_neutral + I(t) (x_emotion - x_neutral)`, frames [T, C], intensity [P] of each phone, smoothed over time."""
    share = gaussian_filter1d(np.repeat(intensity, np.diff(bounds)), SMOOTH_S * fps, mode="nearest")[:, None]
    return neutral + share * (expressive - neutral)
