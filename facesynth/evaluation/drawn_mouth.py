"""Measures of a mouth in drawn video: does what is between the lips move rigidly, does it blink, does the picture jump."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import shift as shifted

from facesynth.inference.arrays import Floats

FARTHEST_PX = 3
"""Teeth move no further from one picture to the next."""
FEWEST_PIXELS = 12
"""A mouth that shows less is shut."""
SUDDEN = 3.0
"""A step of the picture that is so many times the recorded median is a jump that one sees."""


@dataclass(frozen=True)
class Teeth:
    """How what is between the lips behaves from picture to picture; NaN where the mouth never opens."""

    left_over: float
    """RMS brightness that the best rigid shift of the interior does not explain, what bends or is replaced; of its spread."""
    blinking: float
    """Mean change of the share of the open mouth that is bright, that is, in which teeth are seen."""


def teeth(grey: Floats, inside: NDArray[np.bool_]) -> Teeth:
    """Of pictures [T, h, w] in head-fixed pixels, where the lips' inside [T, h, w] is seen.

    Teeth are brighter than the middle between what is dark in there and what is bright: the light of a clip does not count.
    """
    if not inside.any():
        return Teeth(np.nan, np.nan)
    dark, light = np.percentile(grey[inside], [10, 95])
    bright, spread = (dark + light) / 2, max(float(grey[inside].std()), 1e-9)
    rests, changes = [], []
    for t in range(1, len(grey)):
        both = inside[t] & inside[t - 1]
        if both.sum() >= FEWEST_PIXELS:
            rests.append(rigid_rest(grey[t - 1], grey[t], both))
        if min(inside[t].sum(), inside[t - 1].sum()) >= FEWEST_PIXELS:
            shares = [float((grey[k][inside[k]] > bright).mean()) for k in (t - 1, t)]
            changes.append(abs(shares[1] - shares[0]))
    return Teeth(float(np.mean(rests)) / spread if rests else np.nan, float(np.mean(changes)) if changes else np.nan)


def rigid_rest(before: Floats, after: Floats, where: NDArray[np.bool_]) -> float:
    """RMS difference of two pictures [h, w] in a mask, after the shift by whole and then tenth pixels that makes it least."""
    rows, columns = np.nonzero(where)
    reach = FARTHEST_PX + 2
    box = (
        slice(max(rows.min() - reach, 0), rows.max() + reach + 1),
        slice(max(columns.min() - reach, 0), columns.max() + reach + 1),
    )
    a, b, mask = before[box].astype(np.float64), after[box].astype(np.float64), where[box]
    best, step = (0.0, 0.0), 1.0
    least = _apart(a, b, mask, best)
    for around in (FARTHEST_PX, 4, 4):
        centre = best
        for down in range(-around, around + 1):
            for across in range(-around, around + 1):
                moved = centre[0] + step * down, centre[1] + step * across
                if (rest := _apart(a, b, mask, moved)) < least:
                    least, best = rest, moved
        step *= 0.25
    return float(np.sqrt(least))


def _apart(a: Floats, b: Floats, mask: NDArray[np.bool_], moved: tuple[float, float]) -> float:
    return float(np.square(shifted(a, moved, order=1, mode="nearest") - b)[mask].mean())


def steps(grey: Floats) -> Floats:
    """[T - 1] mean change of brightness from each picture [T, h, w] to the next."""
    return np.asarray(np.abs(np.diff(grey.astype(np.float64), axis=0)).mean(axis=(1, 2)))


def sudden(made: Floats, recorded: Floats) -> float:
    """Share of steps [T - 1] that are over SUDDEN times the median of the recorded ones [R]."""
    return float((made > SUDDEN * np.median(recorded)).mean())
