"""Lips that meet at p, b and m, and never pass through each other.

Points of another performer come to the head with the errors of their camera: landmarks on the lips' edges stay a
millimetre or two apart on lips that are shut, and 25 pictures a second miss the moment. Where the phones are known, the
head shuts what such an error left open. Least squares makes errors the other way as well: lips that are shut would cross.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facesynth.face.markers import LipGap
from facesynth.speech.phones import BILABIALS
from facesynth.speech.speech import PhoneTrack

MOST_MM = 3.0
"""A mouth that stays open wider than this at p, b or m is not shut: its phones or its motion are elsewhere."""
WIDTH_S = 0.05
"""Standard deviation of the bump by which the mouth narrows around the moment of least opening."""


TOUCHING_MM = 0.005
"""Lips that cross by less touch."""
STEADY = 0.2
"""mm² that a weight of 1 costs beside the lips' gaps where crossed lips are parted."""
ROUNDS = 30


def with_lips_apart(weights: ArrayLike, lips: LipGap) -> NDArray[np.float64]:
    """Weights [T, 52] in 0..1 whose lips cross at none of the seven places; frames in which none do are left alone.

    The gaps are linear in the weights, g = S w + g0. Where some are negative, the step d = S' (S S' + STEADY)^-1 max(-g, 0)
    lifts those and hardly moves the others; clipping to 0..1 takes some of it back, so it is repeated.
    """
    values = np.clip(np.asarray(weights, np.float64), 0, 1)
    slopes = lips.slopes_mm
    lift = np.linalg.solve(slopes @ slopes.T + STEADY * np.eye(len(slopes)), slopes)
    for _ in range(ROUNDS):
        crossed_mm = np.maximum(-lips.gaps_mm(values), 0.0)
        if crossed_mm.max(initial=0.0) < TOUCHING_MM:
            break
        values = np.clip(values + crossed_mm @ lift, 0, 1)
    return values


def with_lips_met(weights: ArrayLike, lips: LipGap, phones: PhoneTrack, fps: float) -> NDArray[np.float64]:
    """Weights [T, 52] with the lips brought together at the moment of least opening of each p, b and m."""
    opening_mm = lips.opening_mm(weights)
    frames = np.arange(len(opening_mm))
    narrower_mm = np.zeros(len(opening_mm))
    for first, last in _bilabials(phones, fps, len(opening_mm)):
        moment = first + int(opening_mm[first:last].argmin())
        if 0 < opening_mm[moment] <= MOST_MM:
            bump = np.exp(-0.5 * ((frames - moment) / (WIDTH_S * fps)) ** 2)
            narrower_mm = np.maximum(narrower_mm, opening_mm[moment] * bump)
    return np.clip(lips.closed(weights, np.maximum(opening_mm - narrower_mm, 0.0)), 0, 1)


def _bilabials(phones: PhoneTrack, fps: float, count: int) -> list[tuple[int, int]]:
    """First frame and the one after the last of each p, b and m; at least one frame each."""
    ends = np.rint(phones.ends_s * fps).astype(int)
    starts = np.r_[0, ends[:-1]]
    spans = [
        (start, max(end, start + 1)) for label, start, end in zip(phones.labels, starts, ends, strict=True) if label in BILABIALS
    ]
    return [(start, min(end, count)) for start, end in spans if start < count]
