"""Frames that carry their own times, at a steady rate."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.arrays import Floats
from facesynth.inference.errors import FacesynthError
from facesynth.motion.gaps import LONGEST_S
from facesynth.motion.irregular import ROUNDING_S, UNSTEADY, USUAL_FPS, read_at, steady_rate


def at_steady_rate(
    path: Path, signal: NDArray[np.floating], times_s: Floats
) -> tuple[NDArray[np.float32], float, tuple[str, ...]]:
    """A signal [T, C] with frames at `times_s` [T] from its first time on, its rate, and what was noticed.

    FacesynthError where times go back. Frames that were lost leave gaps where they are longer than what is filled; those that
    are there twice are read once.
    """
    again = np.flatnonzero((np.diff(times_s) == 0) & _same_as_before(signal)) + 1
    told = (f"{len(again)} of {len(signal)} frames are there twice; each was read once",) if len(again) else ()
    signal, times_s = np.delete(signal, again, axis=0), np.delete(times_s, again)
    steps = np.diff(times_s)
    if len(times_s) < 2 or not np.isfinite(times_s).all() or (steps <= 0).any():
        row = int(np.argmax(~(steps > 0))) + 2 if len(steps) else 1
        row += int(np.count_nonzero(again < row))
        raise FacesynthError(f"{path}: the time of frame {row} does not lie after the one before; cut the file there")
    since_s = times_s - times_s[0]
    fps, even = _rate(times_s)
    usual = min(USUAL_FPS, key=lambda rate: abs(rate - fps))
    fps = usual if np.abs(since_s * usual - np.rint(since_s * usual)).max() <= ROUNDING_S * usual else fps
    if even:
        return signal.astype(np.float32), fps, told
    regular_s = np.arange(int((since_s[-1] + ROUNDING_S) * fps) + 1) / fps
    said = f"frames do not come at a steady rate: they were interpolated at their own times, at {fps:g} fps"
    placed = read_at(signal, since_s, regular_s, LONGEST_S, ROUNDING_S)
    lowest, highest = np.nanmin(signal, axis=0, initial=np.inf), np.nanmax(signal, axis=0, initial=-np.inf)
    return np.clip(placed, lowest, highest).astype(np.float32), fps, (*told, said)  # splines swing beyond what was measured


def _same_as_before(signal: NDArray[np.floating]) -> NDArray[np.bool_]:
    """[T - 1] whether a frame holds the same as the one before it."""
    return np.asarray((np.nan_to_num(signal[1:]) == np.nan_to_num(signal[:-1])).all(axis=1))


# Where frames were lost the other steps are all one frame, and those across the gaps are whole multiples of it.
def _rate(times_s: Floats) -> tuple[float, bool]:
    """A rate (Hz) at which frames at `times_s` [T] lose nothing, and whether they lie at regular times already."""
    steps = np.diff(times_s)
    usual = float(np.median(steps))
    counts = np.rint(steps / usual)
    if (counts >= 1).all() and np.abs(steps / usual - counts).max() <= UNSTEADY:
        return float(counts.sum() / (times_s[-1] - times_s[0])), bool((counts == 1).all())
    return steady_rate(times_s, 1 / usual)
