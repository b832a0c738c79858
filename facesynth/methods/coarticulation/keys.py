"""Key shapes of phones from recordings: means that few samples draw to their class, and what neighbours change of them."""

from dataclasses import dataclass

import numpy as np

from facesynth.inference.arrays import Floats, Ints
from facesynth.inference.coarticulation.blending import KeyShapes, pace_of
from facesynth.inference.coarticulation.model import CLASS_OF
from facesynth.inference.phones import PHONES, VISEME_CLASSES

FAR = 3.0
"""How many times as strongly changes by phones two away are drawn to nothing as those by neighbours."""
USUAL_S = 0.08
"""Length of a phone of a class that was never recorded, s."""


@dataclass(frozen=True, eq=False)
class PhoneSamples:
    """Middle frames of recorded phones, as displacements from rest."""

    shapes: Floats
    """[N, D]"""
    phones: Ints
    """[N] index of the phone."""
    around: Ints
    """[N, 4] viseme classes of the phones two before, one before, one after and two after; -1 beyond the recording."""
    lengths_s: Floats
    """[N]"""


def learn_keys(samples: PhoneSamples, *, shrink: float, context: float) -> KeyShapes:
    """Key shapes of all phones.

    shrink: so many samples of its class does a phone's mean count beside its own; a class nobody recorded rests.
    context: the same for changes by neighbours and length, which are found by ridge regression; 0 leaves them out.
    """
    size, width = len(VISEME_CLASSES), samples.shapes.shape[1]
    classes = CLASS_OF[samples.phones]
    usual_s = np.array([np.exp(_mean(np.log(samples.lengths_s[classes == c]), np.log(USUAL_S))) for c in range(size)])
    class_means = np.stack([_mean(samples.shapes[classes == c], np.zeros(width)) for c in range(size)])
    own = np.stack([_drawn(samples.shapes[samples.phones == n], class_means[CLASS_OF[n]], shrink) for n in range(len(PHONES))])
    if not context or not len(samples.phones):
        pairs, singles = np.zeros((size, size, width)), np.zeros((size, width))
        return KeyShapes(own, pairs, pairs, singles, singles, singles, usual_s)
    parts = _design(samples, classes, pace_of(samples.lengths_s, usual_s[classes]))
    design = np.hstack(parts)
    strength = context * np.repeat([1, 1, FAR, FAR, 1], [part.shape[1] for part in parts])
    changes = np.linalg.solve(design.T @ design + np.diag(strength), design.T @ (samples.shapes - own[samples.phones]))
    left, right, far_left, far_right, pace = np.split(changes, np.cumsum([part.shape[1] for part in parts])[:-1])
    pair = (size, size, width)
    return KeyShapes(own, left.reshape(pair), right.reshape(pair), far_left, far_right, pace, usual_s)


def _design(samples: PhoneSamples, classes: Ints, pace: Floats) -> list[Floats]:
    """Columns of the regression: pairs with the phone before and after, classes two away, length by class."""
    size = len(VISEME_CLASSES)
    far_left, before, after, far_right = samples.around.T
    return [
        _one_hot(np.where(before >= 0, before * size + classes, -1), size**2),
        _one_hot(np.where(after >= 0, classes * size + after, -1), size**2),
        _one_hot(far_left, size),
        _one_hot(far_right, size),
        _one_hot(classes, size) * pace[:, None],
    ]


def _one_hot(numbers: Ints, size: int) -> Floats:
    """[N, size] a 1 at each number, nothing where it is -1."""
    rows = np.zeros((len(numbers), size))
    known = np.flatnonzero(numbers >= 0)
    rows[known, numbers[known]] = 1
    return rows


def _mean(values: Floats, otherwise: Floats) -> Floats:
    return np.asarray(values.mean(axis=0) if len(values) else otherwise)


def _drawn(values: Floats, towards: Floats, count: float) -> Floats:
    return np.asarray((values.sum(axis=0) + count * towards) / (len(values) + count) if len(values) else towards)
