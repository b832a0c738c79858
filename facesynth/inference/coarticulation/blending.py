"""Visible speech as a blend of key shapes: how much of each counts at each moment follows from the phones around it.

Deng 2006, §5.2: between the middles of two phones (a diphone) or of three (a triphone) a pose is the sum of their key shapes,
weighted by polynomials in the time normalised to 0..1. Algorithm 1 lays such models end to end; where two triphones share an
interval, `catBlend` fades the first out and the second in.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Ints
from ..phones import SILENCE
from ..speech import PhoneTrack

SETTLE_S, WAKE_S = 0.25, 0.2
"""A pause longer than both rests from the first after its start until the second before its end, s."""
BLEND_SHARE, BLEND_POWER = 0.5, 1
"""mu and n of eq. 5.10."""


@dataclass(frozen=True, eq=False)
class WeightModels:
    """Polynomials of the time in a transition, by viseme class; V classes, K coefficients (constant first)."""

    diphones: Floats
    """[V, V, 2, K] of the starting and the ending phone."""
    triphone_keys: Ints
    """[M, 3] classes of the three phones, sorted."""
    triphones: Floats
    """[M, 3, K] of the starting, the middle and the ending phone."""

    def triphone(self, classes: Sequence[int]) -> int:
        """Which triphone model three classes have; -1 where there is none."""
        if not len(self.triphone_keys):
            return -1
        size = len(self.diphones)
        codes = self.triphone_keys @ (size**2, size, 1)
        code = (classes[0] * size + classes[1]) * size + classes[2]
        place = int(np.searchsorted(codes, code))
        return place if place < len(codes) and codes[place] == code else -1


@dataclass(frozen=True, eq=False)
class Anchors:
    """Moments at which a key shape is meant, in the order of time."""

    times_s: Floats
    """[n] strictly increasing."""
    phones: Ints
    """[n] index of the phone that each belongs to."""


@dataclass(frozen=True)
class Span:
    """One model laid over the anchors `first` to `first + 1` (a diphone) or `first + 2` (a triphone)."""

    first: int
    triphone: int
    """Number of the triphone model; -1 for a diphone."""

    @property
    def last(self) -> int:
        """Its last anchor."""
        return self.first + (1 if self.triphone < 0 else 2)


@dataclass(frozen=True, eq=False)
class KeyShapes:
    """What a face is at the middle of a phone, as displacements from rest in D components.

    A phone's own shape, and how its neighbours' viseme classes and its length change it. By hand, only the shapes are given.
    """

    phones: Floats
    """[N, D] of each phone of `PHONES`."""
    left: Floats
    """[V, V, D] change of a phone of the second class after one of the first."""
    right: Floats
    """[V, V, D] change of a phone of the first class before one of the second."""
    far_left: Floats
    """[V, D] change two phones after one of a class."""
    far_right: Floats
    """[V, D] change two phones before one of a class."""
    pace: Floats
    """[V, D] change for each unit of the logarithm of the length over the usual one."""
    usual_s: Floats
    """[V] usual length of a phone of each class, s."""

    def of(self, numbers: Ints, classes: Ints, lengths_s: Floats) -> Floats:
        """[P, D] key shapes of phones one after the other; nothing stands before the first and after the last."""
        shapes = self.phones[numbers] + pace_of(lengths_s, self.usual_s[classes])[:, None] * self.pace[classes]
        shapes[1:] += self.left[classes[:-1], classes[1:]]
        shapes[:-1] += self.right[classes[:-1], classes[1:]]
        shapes[2:] += self.far_left[classes[:-2]]
        shapes[:-2] += self.far_right[classes[2:]]
        return shapes


def pace_of(lengths_s: Floats, usual_s: Floats) -> Floats:
    """[P] logarithm of lengths over usual ones, within a factor of three."""
    return np.clip(np.log(lengths_s / usual_s), -np.log(3), np.log(3))


def anchors_of(phones: PhoneTrack) -> Anchors:
    """The middle of each phone; a long pause is held between two moments, and one at an edge has one moment only."""
    times, owners, count = [], [], len(phones)
    for k, (label, start, end) in enumerate(zip(phones.labels, phones.starts_s, phones.ends_s, strict=True)):
        held = [start + SETTLE_S, end - WAKE_S] if label == SILENCE and end - start > SETTLE_S + WAKE_S else [(start + end) / 2]
        if len(held) == 2 and count > 1:
            held = held[1:] if k == 0 else held[:1] if k == count - 1 else held
        times += held
        owners += [k] * len(held)
    return Anchors(np.array(times), np.array(owners, np.int64))


def cover(classes: Ints, models: WeightModels) -> list[Span]:
    """Algorithm 1 (Deng 2006): triphone models where there are any, diphone models for the intervals that they leave.

    Every interval between neighbouring anchors is covered once, twice only where two triphones overlap.
    """
    spans, i, after_triphone = [], 0, False
    while i < len(classes) - 1:
        model = models.triphone(classes[i : i + 3].tolist()) if i + 2 < len(classes) else -1
        if model >= 0:
            spans.append(Span(i, model))
        elif not after_triphone:
            spans.append(Span(i, -1))
        after_triphone = model >= 0
        i += 1
    return spans


def blend_share(t: Floats) -> Floats:
    """Eq. 5.10: how much the earlier of two overlapping models counts, from 1 at t = 0 to 0 at t = 1."""
    early = BLEND_SHARE * (1 - t) ** (BLEND_POWER + 1)
    return np.asarray(early / (early + (1 - BLEND_SHARE) * t ** (BLEND_POWER + 1)))


def blended(classes: Ints, keys: Floats, anchors_s: Floats, times_s: Floats, models: WeightModels) -> Floats:
    """[T, D] the key shapes [n, D] of n anchors, each counting as the models say at each time [T], which rise.

    Before the first and after the last anchor its shape is held.

    A span of models looks at its own frames and anchors alone, so that time and memory grow with the length, not with its square.
    """
    if len(anchors_s) == 1:
        return np.repeat(keys, len(times_s), axis=0)
    out = np.zeros((len(times_s), keys.shape[1]))
    times_s = np.clip(times_s, anchors_s[0], anchors_s[-1])
    interval = np.clip(np.searchsorted(anchors_s, times_s, side="right") - 1, 0, len(anchors_s) - 2)
    first_rows = np.searchsorted(interval, np.arange(len(anchors_s)))
    spans = cover(classes, models)
    for span, before in zip(spans, [None, *spans], strict=False):
        shared = span.first if before is not None and before.last > span.first else -1
        rows = slice(first_rows[span.first], first_rows[span.last])
        t = (times_s[rows] - anchors_s[span.first]) / (anchors_s[span.last] - anchors_s[span.first])
        polynomials = (
            models.diphones[classes[span.first], classes[span.last]] if span.triphone < 0 else models.triphones[span.triphone]
        )
        own = np.vander(t, polynomials.shape[1], increasing=True) @ polynomials.T
        fading = np.zeros(len(t))
        if shared >= 0:
            here = interval[rows] == shared
            length_s = anchors_s[shared + 1] - anchors_s[shared]
            fading[here] = blend_share((times_s[rows][here] - anchors_s[shared]) / length_s)
        out[rows] = fading[:, None] * out[rows] + (1 - fading)[:, None] * (own @ keys[span.first : span.last + 1])
    return out


def blend_key_shapes(phones: PhoneTrack, classes: Ints, keys: Floats, models: WeightModels, times_s: Floats) -> Floats:
    """[T, D] displacements from rest: classes [P] and key shapes [P, D] of the phones, blended at rising times [T]."""
    anchors = anchors_of(phones)
    return blended(classes[anchors.phones], keys[anchors.phones], anchors.times_s, times_s, models)
