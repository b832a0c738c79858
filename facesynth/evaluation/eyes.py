"""How close synthesised eyes are to recorded ones: distances between distributions, since no blink is at its recorded time."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from scipy.stats import ks_2samp

from facesynth.inference.arrays import Floats
from facesynth.inference.gaze import facing, gaze_shifts
from facesynth.motion.gaps import runs

Samples = Mapping[str, Floats]
"""What was measured, by its name."""

LEAST_DEG = 2.0
"""Rests whose places are nearer than this are one: people and trackers make smaller steps all the time."""
SHUT = 0.2
"""Opening under which an eye is shut, as in the dissertation."""
WINDOW_S = 4.0
"""Of spectra and of what eyes and head do together."""


@dataclass(frozen=True, eq=False)
class Fixation:
    """The gaze rests from frame `start` to before `stop`."""

    start: int
    stop: int
    place: Floats
    """[2] mean direction, rad"""


def fixations(gaze: Floats, fps: float) -> list[Fixation]:
    """Rests of a gaze [T, 2] (rad) between its shifts; those less than LEAST_DEG apart are one."""
    shifts = gaze_shifts(gaze, fps)
    starts, stops = [0, *(shift.stop for shift in shifts)], [*(shift.start + 1 for shift in shifts), len(gaze)]
    found: list[Fixation] = []
    for start, stop in zip(starts, stops, strict=True):
        here = Fixation(start, stop, gaze[start:stop].mean(axis=0))
        if found and np.hypot(*(here.place - found[-1].place)) < np.radians(LEAST_DEG):
            first = found.pop().start
            here = Fixation(first, stop, gaze[first:stop].mean(axis=0))
        found.append(here)
    return found


def fixation_statistics(gaze: Floats, fps: float) -> Samples:
    """How long rests of a gaze [T, 2] last and how far the shifts between them go; what the ends cut off is left out."""
    found = fixations(gaze, fps)
    places = np.degrees(np.array([one.place for one in found]))
    return {
        "fixation, s": np.array([(one.stop - one.start) / fps for one in found[1:-1]]),
        "shift, °": np.hypot(*np.diff(places, axis=0).T),
    }


def gaze_statistics(gaze: Floats, head: NDArray[np.floating], fps: float) -> Samples:
    """Speed, range and spectrum of a gaze [T, 2] in the head (rad), and what it has to do with a head [T, 6]."""
    speed = np.degrees(np.hypot(*np.diff(gaze, axis=0).T)) * fps
    away = np.degrees(gaze - np.median(gaze, axis=0))
    return {
        "speed, °/s": speed,
        "sideways, °": away[:, 0],
        "up, °": away[:, 1],
        "spectrum, Hz": _middle_frequencies(gaze, fps),
        "with the head": _correlations(gaze, facing(head), fps),
    }


def blink_statistics(opening: Floats, fps: float) -> Samples:
    """How long blinks of lids [T] last, and the time from one to the next; and how far the lids are open between them."""
    shut = runs(opening < SHUT)
    starts = np.array([one.start for one in shut if one.start > 0], np.float64)
    return {
        "blink, s": np.array([len(one) / fps for one in shut if one.start > 0 and one.stop < len(opening)]),
        "between blinks, s": np.diff(starts) / fps,
        "blinks a minute": np.array([60 * fps * len(starts) / len(opening)]),
        "opening": opening,
    }


def pooled(parts: list[Samples]) -> Samples:
    """Samples of several recordings together."""
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def distances(mine: Samples, recorded: Samples) -> dict[str, float]:
    """Kolmogorov-Smirnov distance (0 alike, 1 apart) of each statistic; 1 where one side never does it."""
    return {
        name: float(ks_2samp(mine[name], values).statistic) if len(mine[name]) and len(values) else 1.0
        for name, values in recorded.items()
    }


def averaged(gaze: Floats, frames: int) -> Floats:
    """A gaze [T, 2] as a recording that was averaged over so many frames shows it."""
    return uniform_filter1d(gaze, frames, axis=0, mode="nearest")


# The frequency that halves the power of the gaze's changes, for each window of half-overlapping Hann windows.
def _middle_frequencies(gaze: Floats, fps: float) -> Floats:
    moves = _windows(np.diff(gaze, axis=0), fps)
    power = np.square(np.abs(np.fft.rfft(moves * np.hanning(moves.shape[1])[:, None], axis=1))).sum(axis=2)
    shares = np.cumsum(power, axis=1) / np.maximum(power.sum(axis=1, keepdims=True), 1e-30)
    return np.fft.rfftfreq(moves.shape[1], 1 / fps)[(shares < 0.5).sum(axis=1)]


def _correlations(gaze: Floats, head: Floats, fps: float) -> Floats:
    """Of gaze and head sideways, for each window; 0 where one of them rests."""
    mine, yours = (_windows(angles[:, :1], fps)[:, :, 0] for angles in (gaze, head))
    mine, yours = (angles - angles.mean(axis=1, keepdims=True) for angles in (mine, yours))
    size = np.sqrt(np.square(mine).sum(axis=1) * np.square(yours).sum(axis=1))
    return (mine * yours).sum(axis=1) / np.maximum(size, 1e-9)


def _windows(signal: Floats, fps: float) -> Floats:
    """[N, W, C] half-overlapping windows of a signal [T, C]; none of a shorter one."""
    width = round(WINDOW_S * fps)
    if len(signal) < width:
        return np.zeros((0, width, signal.shape[1]))
    return np.stack([signal[start : start + width] for start in range(0, len(signal) - width + 1, width // 2)])
