"""Lips that meet at p, b and m.

Points of another performer come to the head with the errors of their camera: landmarks on the lips' edges stay a
millimetre or two apart on lips that are shut, and 25 pictures a second miss the moment. Where the phones are known, the
head shuts what such an error left open.
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
