"""Key shapes of phones from recordings: means that few samples draw to their class, and what neighbours change of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facesynth.inference.coarticulation import Floats, Ints, KeyShapes, pace_of
from facesynth.inference.phones import PHONES, VISEME_CLASSES, viseme_of

USUAL_S = 0.08
"""Length of a phone of a class that was never recorded, s."""
CLASS_OF = np.array([viseme_of(phone) for phone in PHONES])


@dataclass(frozen=True, eq=False)
class PhoneSamples:
    """Middle frames of recorded phones, as displacements from rest."""

    shapes: Floats
    """[N, D]"""
    phones: Ints
    """[N] index of the phone."""
    before: Ints
    """[N] viseme class of the phone before, -1 at the start of a recording."""
    after: Ints
    """[N] viseme class of the phone after, -1 at the end."""
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
    nothing = KeyShapes(own, np.zeros((size, size, width)), np.zeros((size, size, width)), np.zeros((size, width)), usual_s)
    if not context or not len(samples.phones):
        return nothing
    # One column for each pair of classes on either side, and one for the length in each class.
    before, after = samples.before >= 0, samples.after >= 0
    design = np.zeros((len(classes), 2 * size**2 + size))
    rows = np.arange(len(classes))
    design[rows[before], samples.before[before] * size + classes[before]] = 1
    design[rows[after], size**2 + classes[after] * size + samples.after[after]] = 1
    design[rows, 2 * size**2 + classes] = pace_of(samples.lengths_s, usual_s[classes])
    residual = samples.shapes - own[samples.phones]
    changes = np.linalg.solve(design.T @ design + context * np.eye(design.shape[1]), design.T @ residual)
    left, right, pace = np.split(changes, [size**2, 2 * size**2])
    return KeyShapes(own, left.reshape(size, size, -1), right.reshape(size, size, -1), pace, usual_s)


def _mean(values: Floats, otherwise: Floats) -> Floats:
    return np.asarray(values.mean(axis=0) if len(values) else otherwise)


def _drawn(values: Floats, towards: Floats, count: float) -> Floats:
    return np.asarray((values.sum(axis=0) + count * towards) / (len(values) + count))
