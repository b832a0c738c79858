"""Lips that meet at p, b and m, and never pass through each other.

Points of another performer come to the head with the errors of their camera: landmarks on the lips' edges stay a
millimetre or two apart on lips that are shut, and 25 pictures a second miss the moment. Where the phones are known, the
head shuts what such an error left open. Least squares makes errors the other way as well: lips that are shut would cross.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facesynth.face.animation import FaceAnimation
from facesynth.face.rig.markers import LipGap
from facesynth.inference.lips import bilabial_spans
from facesynth.inference.long_arrays import by_blocks
from facesynth.inference.speech import PhoneTrack
from facesynth.motion.arkit_names import ARKIT_NAMES

LARGEST_CLOSURE_MM = 3.0
"""A mouth that stays open wider than this at p, b or m is not shut: its phones or its motion are elsewhere."""
LARGEST_SHUT_MM = 2.0
"""Points of shut lips stay at most so far apart over the rest pose."""
FEWEST_CLOSURES = 2
"""From so many p, b and m on they tell where this performer's lips are shut."""
FADING_MM = 3.0
"""What is taken off at shut lips fades out over so many millimetres."""
WIDTH_S = 0.05
"""Standard deviation of the bump by which the mouth narrows around the moment of least opening."""


MOUTH = tuple(i for i, name in enumerate(ARKIT_NAMES) if name.startswith(("jaw", "mouth", "tongue")))
NEARER_MM = 0.1
"""Lips that come nearer by less between two frames are as good as shut in them."""
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
    """Weights [T, 52] with the lips brought together at the moment of least opening of each p, b and m.

    What most of these moments left open is shut lips for this performer, and is taken off everywhere.
    """
    opening_mm = lips.opening_mm(weights)
    frames = np.arange(len(opening_mm))
    narrower_mm = np.zeros(len(opening_mm))
    spans = [(a, max(min(b, len(frames)), a + 1)) for a, b in bilabial_spans(phones, fps) if a < len(frames)]
    opening_mm = from_shut(opening_mm, [float(opening_mm[first:last].min()) for first, last in spans])
    for first, last in spans:
        moment = first + int(opening_mm[first:last].argmin())
        if 0 < opening_mm[moment] <= LARGEST_CLOSURE_MM:
            bump = np.exp(-0.5 * ((frames - moment) / (WIDTH_S * fps)) ** 2)
            narrower_mm = np.maximum(narrower_mm, opening_mm[moment] * bump)
    return np.clip(lips.closed(weights, np.maximum(opening_mm - narrower_mm, 0.0)), 0, 1)


# At 12 pictures a second one stands for 83 ms, and lips are shut for 50 to 80: a closure may lie between two pictures.
def with_closures_shown(shown: FaceAnimation, whole: FaceAnimation, lips: LipGap, phones: PhoneTrack) -> FaceAnimation:
    """An animation of ARKit's shapes at a lower rate than `whole`, in which the lips are as near at each p, b and m.

    Where they come nearer between two frames than in either, the nearest frame takes the mouth of that moment.
    """
    if shown.fps >= whole.fps or shown.names != ARKIT_NAMES:
        return shown
    weights = shown.weights.copy()
    wide_mm, seen_mm = (by_blocks(lips.opening_mm, each, np.float64) for each in (whole.weights, weights))
    for first, last in bilabial_spans(phones, whole.fps):
        if first >= len(whole):
            continue
        moment = first + int(wide_mm[first : max(last, first + 1)].argmin())
        nearest = min(round(moment / whole.fps * shown.fps), len(shown) - 1)
        if seen_mm[nearest] > wide_mm[moment] + NEARER_MM:
            weights[nearest, MOUTH] = whole.weights[moment, MOUTH]
            seen_mm[nearest] = wide_mm[moment]
    return replace(shown, weights=weights)


def from_shut(opening_mm: NDArray[np.float64], least_mm: Sequence[float]) -> NDArray[np.float64]:
    """Openings [T] counted from shut lips: 0 where they are as at most p, b and m (least_mm), unchanged where they are wide."""
    if len(least_mm) < FEWEST_CLOSURES:
        return opening_mm
    shut_mm = float(np.clip(np.median(least_mm), 0, LARGEST_SHUT_MM))
    over_mm = np.maximum(opening_mm - shut_mm, 0)
    from_zero = over_mm + shut_mm * -np.expm1(-over_mm / FADING_MM)
    return np.where(opening_mm > 0, np.minimum(from_zero, opening_mm), opening_mm)
