"""Signals whose samples do not lie at regular times: their rate, and their values at the times between."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from facesynth.inference.arrays import Floats
from facesynth.motion.gaps import missing_in

USUAL_FPS = (24000 / 1001, 24, 25, 30000 / 1001, 30, 48, 50, 60000 / 1001, 60, 90, 100, 120, 150, 200, 240, 250, 300, 400, 500)
"""Rates of cameras and capture systems, Hz."""
UNSTEADY = 0.25
"""Of the median step between samples: steps that differ by more make the rate variable."""
STRAY = 0.25
"""Samples by which the rate that a file states may be wrong at its end; otherwise the time stamps tell the rate."""
QUICK = 24
"""Where the rate varies, the quickest so many steps in a row tell it: what was sampled quickly shall not lose samples."""
USUAL_SHARE = 0.05
"""A usual rate so near is meant: time stamps tremble."""
ROUNDING_S = 0.0015
"""By which time stamps that are rounded to milliseconds lie beside the time that is meant."""


def steady_rate(times_s: Sequence[float] | Floats, stated_fps: float) -> tuple[float, bool]:
    """A rate (Hz) at which samples at `times_s` [T > 1] lose nothing, and whether they lie at regular times already."""
    times = np.asarray(times_s, np.float64)
    steps = np.diff(times)
    typical = float(np.median(steps))
    even = bool((np.abs(steps - typical) <= UNSTEADY * typical).all())
    fps = (len(times) - 1) / (times[-1] - times[0]) if even else max(1 / typical, quickest(times))
    if abs(stated_fps / fps - 1) * len(times) < STRAY:
        return stated_fps, even
    nearest = min(USUAL_FPS, key=lambda usual: abs(usual - fps))
    return (nearest if not even and abs(nearest / fps - 1) <= USUAL_SHARE else float(fps)), even


def quickest(times: Floats) -> float:
    """Rate (Hz) of the quickest stretch of QUICK steps."""
    count = min(QUICK, len(times) - 1)
    return count / float((times[count:] - times[:-count]).min())


def read_at(
    signal: NDArray[np.floating], times: Floats, wanted: Floats, longest: float = np.inf, near: float = 1e-6
) -> NDArray[np.float32]:
    """A signal [T, C] with samples at rising `times` [T], at other times [T']: cubic splines through what is present.

    NaN beyond its ends, between samples further apart than `longest`, and where one of the two beside is missing. A time
    is that of a sample where they differ by no more than `near`.
    """
    missing = missing_in(signal)
    known = np.flatnonzero(~missing)
    result = np.full((len(wanted), signal.shape[1]), np.nan, np.float32)
    if len(known) < 2:
        return result
    before = np.searchsorted(times, wanted + near, side="right") - 1
    after = np.searchsorted(times, wanted - near, side="left")
    inside = (before >= 0) & (after < len(times))
    before, after = before[inside], after[inside]
    places = np.clip(wanted[inside], times[0], times[-1])
    values = make_interp_spline(times[known], signal[known].astype(np.float64), k=min(3, len(known) - 1))(places)
    values[missing[before] | missing[after] | (times[after] - times[before] > longest)] = np.nan
    result[inside] = values
    return result
