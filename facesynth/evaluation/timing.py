"""Whether the mouth moves when the recorded one did, not only as it did."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks

from facesynth.evaluation.lips import lip_opening
from facesynth.evaluation.pair import Array, UnavailableError, require_alike
from facesynth.evaluation.time_alignment import dtw_path
from facesynth.inference.motion import Motion

LONGEST_LAG_S = 0.25
"""No larger shift between sound and lips is looked for, s."""
PROMINENCE = 0.1
"""An extremum stands out by this share of the range of the recorded opening; smaller ones are noise."""


def lip_lag(synthesised: Motion, truth: Motion) -> float:
    """Shift at which the lip opening correlates best with the truth's (ms), positive where it comes late.

    Shifts up to 250 ms, but never more than half of the utterance; between frames by the parabola
    through the best three correlations.
    """
    mine, yours = _openings(synthesised, truth)
    longest = min(round(LONGEST_LAG_S * truth.fps), len(yours) // 2 - 1)
    scores = np.array([_correlation_at(mine, yours, lag) for lag in range(-longest, longest + 1)])
    best = int(scores.argmax())
    if not scores[best] > 0:
        raise UnavailableError("the synthesised mouth follows the recorded one at no shift")
    return float(best + _parabola_top(scores, best) - longest) / truth.fps * 1000


def lip_extrema_lag(synthesised: Motion, truth: Motion) -> float:
    """Mean |dt| (ms) between the truth's opening and closing extremes and where they are in the synthesised opening.

    Derivative DTW (Keogh and Pazzani 2001) of the two openings, each derivative divided by its standard
    deviation, within 250 ms of the diagonal; each extremum of the truth lies at the mean time of the
    synthesised frames matched with it.
    """
    mine, yours = _openings(synthesised, truth)
    extrema = _extrema(yours)
    if not extrema.size:
        raise UnavailableError("the recorded mouth has no opening or closing that stands out")
    slopes = [_slope(signal) for signal in (mine, yours)]
    if not slopes[0].std() > 0:
        raise UnavailableError("the synthesised mouth stands still")
    radius = max(1, round(LONGEST_LAG_S * truth.fps))
    mine, yours = (slope[:, None] / slope.std() for slope in slopes)
    path = dtw_path(mine, yours, radius)
    matched = [path[path[:, 1] == frame, 0].mean() - frame for frame in extrema]
    return float(np.abs(matched).mean()) / truth.fps * 1000


def _openings(synthesised: Motion, truth: Motion) -> tuple[Array, Array]:
    """[T] both openings, the truth's gaps in time bridged linearly so that time stays uniform."""
    require_alike(synthesised, truth)
    mine, yours = lip_opening(synthesised), lip_opening(truth)
    present = np.flatnonzero(~np.isnan(yours))
    if len(present) < 8 or not yours[present].std() > 0:
        raise UnavailableError("the recorded mouth stands still or is missing")
    return mine, np.interp(np.arange(len(yours)), present, yours[present])


def _correlation_at(mine: Array, yours: Array, lag: int) -> float:
    """Pearson correlation of mine[t + lag] with yours[t] over the frames that both have."""
    late, early = (mine[lag:], yours[: len(yours) - lag]) if lag >= 0 else (mine[:lag], yours[-lag:])
    spread = late.std() * early.std()
    return float(((late - late.mean()) * (early - early.mean())).mean() / spread) if spread > 1e-12 else 0.0


def _parabola_top(scores: Array, best: int) -> float:
    if not 0 < best < len(scores) - 1:
        return 0.0
    before, at, after = scores[best - 1 : best + 2]
    bend = before - 2 * at + after
    return float(0.5 * (before - after) / bend) if bend < 0 else 0.0


def _extrema(opening: Array) -> NDArray[np.int64]:
    prominence = PROMINENCE * np.ptp(opening)
    return np.sort(np.concatenate([find_peaks(sign * opening, prominence=prominence)[0] for sign in (1, -1)]))


def _slope(signal: Array) -> Array:
    """Keogh and Pazzani's estimate: the mean of the step in and half the step across; ends repeat."""
    inner = ((signal[1:-1] - signal[:-2]) + (signal[2:] - signal[:-2]) / 2) / 2
    return np.concatenate([inner[:1], inner, inner[-1:]])
