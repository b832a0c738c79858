"""The mouth's movement made larger or smaller without losing its closures, and mouthClose kept within jawOpen.

On ARKit's heads mouthClose undoes jawOpen at the lips: more of it than of the jaw drives one lip through the other.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facesynth.face.rig.markers import MIDDLE_LIPS, LipGap
from facesynth.face.solve.closures import with_lips_apart
from facesynth.inference.errors import FacesynthError
from facesynth.motion.arkit_names import ARKIT_NAMES

MOUTH = tuple(i for i, name in enumerate(ARKIT_NAMES) if name.startswith(("jaw", "mouth", "tongue")))
JAW, CLOSE = ARKIT_NAMES.index("jawOpen"), ARKIT_NAMES.index("mouthClose")
SHUT_MM, OPEN_MM = 0.7, 2.0
"""Lips nearer than the first are shut and stay as near; wider than the second they are free; between, less and less."""


# The gaps of the lips are linear in the weights: times g, a gap becomes r + g (gap - r), with r the gap at rest. For g < 1 that
# brings shut lips nearer to rest, where they are shut as well; a larger g would drive them apart or through each other, so it
# fades to 1 as the lips come together.
def amplified(weights: ArrayLike, gain: float, lips: LipGap) -> NDArray[np.float64]:
    """Weights [T, 52] with the mouth's times `gain`, in 0..1; lips that were shut stay shut, and none pass through each other."""
    if not (np.isfinite(gain) and gain >= 0):
        raise FacesynthError(f"a gain of the mouth must be 0 (still) or a positive factor; got {gain}")
    values = np.clip(np.asarray(weights, np.float64), 0, 1)
    if gain > 1:
        free = np.clip((lips.opening_mm(values) - SHUT_MM) / (OPEN_MM - SHUT_MM), 0, 1)
        values[:, MOUTH] *= 1 + (gain - 1) * free[:, None]
        values[:, [JAW, CLOSE]] /= np.maximum(values[:, [JAW, CLOSE]].max(axis=1, keepdims=True), 1.0)
        moved = free > 0
        values[np.ix_(moved, np.array(MOUTH))] = with_lips_apart(values[moved], lips)[:, MOUTH]
        return np.clip(values, 0, 1)
    values[:, MOUTH] *= gain
    return values


# What mouthClose closes beyond the jaw, the shapes that part the lips give way to: with m = excess · |slope of mouthClose| and
# p = Σ slope · weight of those shapes, their weights become (1 - m / p) of what they were.
def close_within_jaw(weights: ArrayLike, lips: LipGap) -> NDArray[np.float64]:
    """Weights [T, 52] whose mouthClose is nowhere above jawOpen, with lips as near as they were."""
    values = np.array(weights, np.float64)
    excess = np.maximum(values[:, CLOSE] - values[:, JAW], 0)
    values[:, CLOSE] -= excess
    slopes_mm = lips.slopes_mm[MIDDLE_LIPS].mean(axis=0)
    parting = [i for i in np.flatnonzero(slopes_mm > 0) if i != JAW]
    open_mm = values[:, parting] @ slopes_mm[parting]
    missing_mm = excess * -slopes_mm[CLOSE]
    values[:, parting] *= 1 - np.clip(missing_mm / np.maximum(open_mm, 1e-9), 0, 1)[:, None]
    return values
