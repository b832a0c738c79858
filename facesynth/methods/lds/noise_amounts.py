"""How much of the noise belongs to which state of speech, and to which component of the shape.

Noise as large as what the sound does not explain makes a sample worse than no motion at all wherever the sound explains
less than half. With y a component of the shape, y_s = y - y_d what the deterministic part leaves of it, and a(t) the amounts,
an independent sample has the mean squared error E[y_s²] + g² E[a²] E[y_s²], and the mean face E[y²]. Amounts follow
what was left in each state (none in closures, where lips are shut for certain); the gain g of each component is 1, or as small
as it takes for a sample to be nearer than the mean face.
"""

from collections.abc import Sequence

import numpy as np

from facesynth.inference.arrays import Ints
from facesynth.inference.speech_state import STATES
from facesynth.methods.lds.system import Array

NEARER = 0.7
"""The squared error that a sample is to have, of that of the mean face."""


def noise_amounts(left: Sequence[Array], states: Sequence[Ints], weights: Array) -> dict[str, float]:
    """Amounts by state, 1 on average, from what is left of the shape [T, p] and the states [T]; weights [p] of components."""
    rest, which = np.concatenate([np.square(one) @ weights for one in left]), np.concatenate(states)
    overall = float(np.sqrt(rest.mean()))
    amounts = {name: _size(rest[which == number], overall) for number, name in enumerate(STATES)}
    return {**amounts, "closure": 0.0, "unknown": 1.0}


def noise_gains(shapes: Sequence[Array], left: Sequence[Array], states: Sequence[Ints], amounts: dict[str, float]) -> Array:
    """[p] gain of each component's noise, from shapes [T, p] and what is left of them."""
    y, rest = (np.square(np.concatenate(signals)).mean(axis=0) for signals in (shapes, left))
    squared = float(np.square([amounts[name] for name in STATES])[np.concatenate(states)].mean())
    return np.sqrt(np.clip((NEARER * y - rest) / np.maximum(squared * rest, 1e-12), 0, 1))


def _size(rest: Array, overall: float) -> float:
    """RMS of what is left in some frames, relative to all."""
    return float(np.sqrt(rest.mean())) / overall if len(rest) and overall > 0 else 1.0
