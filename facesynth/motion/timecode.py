"""Frame rates of film and television, and time as hours, minutes, seconds and frames."""

import math
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.arrays import Floats
from facesynth.inference.errors import FacesynthError

RATES = (10, 12, 15, 20, 24, 25, 30, 48, 50, 60, 90, 100, 120, 240)
"""Frames that time codes count in a second."""
PARTS_OF_A_SECOND = (1000, 10_000, 100_000, 1_000_000)
"""Or what they count otherwise."""
SLOWEST = 23
"""Frame numbers below it tell no rate within a second: a take of half a second has such low ones too."""
WHOLE_SECOND = (30, 60)
"""So many frames within one second are taken for all of it, and told; fewer or others do not show the rate."""
NOON_S, DAY_S = 43200, 86400
_TIMECODE = re.compile(r"(\d{1,3})[:;]([0-5]\d)[:;]([0-5]\d)([:;.,])(\d{2,6})(?:[.,](\d+))?")


def nominal_rate(fps: float) -> int:
    """Frames that a timecode counts in a second: 30 for 29.97, 24 for 23.976, 60 for 60."""
    return math.ceil(fps - 1e-6)


def timecode(time_s: float, rate: int) -> str:
    """`HH:MM:SS:FF.mmm`: a time on the clock, in frames of 1/rate s and thousandths of such a frame.

    A take of 29.97 fps therefore steps by 1.001 frames of 1/30 s: the timecode stays with the clock
    and with the sound, as in takes of the Live Link Face app, instead of falling behind by 3.6 s an hour.
    """
    thousandths = round(time_s * rate * 1000)
    frames, part = divmod(thousandths, 1000)
    seconds, frame = divmod(frames, rate)
    return f"{seconds // 3600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}:{frame:02d}.{part:03d}"


def read_timecodes(path: Path, timecodes: Sequence[str], fps: float | None) -> tuple[Floats, int]:
    """[R] times in seconds, rising over midnight, and how many frames, or parts, the time codes count in a second.

    fps: of a take that is too short to show its rate. FacesynthError, with the row where one is at fault.
    """
    fields = [_TIMECODE.fullmatch(text) for text in timecodes]
    for row, (text, match) in enumerate(zip(timecodes, fields, strict=True), start=2):
        if match is None:
            raise FacesynthError(f"{path} row {row}: {text[:40]!r} is no time code; wanted HH:MM:SS:FF.mmm, or HH:MM:SS;FF")
    found = [match for match in fields if match]
    parts = np.array([[int(match[k]) for k in (1, 2, 3, 5)] for match in found], np.int64)
    seconds = parts[:, :3] @ np.array([3600, 60, 1])
    digits = {len(match[5]) for match in found}
    highest = int(parts[:, 3].max()) + 1
    if len(digits) == 1 and min(digits) >= 3 and highest > RATES[-1]:
        counted = 10 ** digits.pop()
        return _over_midnight(seconds + parts[:, 3] / counted), counted
    within = len(np.unique(seconds))
    if fps is None and ((highest < SLOWEST and within < 3) or (within < 2 and highest not in WHOLE_SECOND)):
        raise FacesynthError(f"{path} is too short to show its frame rate; give it (--fps)")
    shown = max(highest, int(np.ceil(fps - 0.05)) if fps and within < 2 else highest)
    counted = min((rate for rate in RATES if rate >= shown), default=shown)
    parted = parts[:, 3] + np.array([float(f"0.{match[6] or 0}") for match in found])
    if any(match[4] == ";" for match in found) or _skips_numbers(parts, counted):
        return _over_midnight(_drop_frame(parts, counted) / (counted * 1000 / 1001)), counted
    return _over_midnight(seconds + parted / counted), counted


def _skips_numbers(parts: NDArray[np.int64], counted: int) -> bool:
    """Whether time codes [R, 4] leave out the first numbers of every minute but each tenth, and only those."""
    if counted % 30:
        return False
    skipped = counted // 15
    _, minutes, seconds, frames = parts.T
    begins = np.flatnonzero(np.diff(minutes) % 60 == 1) + 1
    begins = begins[(minutes[begins] % 10 != 0) & (seconds[begins] == 0)]
    at_once = (seconds[begins - 1] == 59) & (frames[begins - 1] == counted - 1)
    return bool(len(begins)) and bool((at_once & (frames[begins] == skipped)).all())


def _drop_frame(parts: NDArray[np.int64], counted: int) -> Floats:
    """[R] frames since midnight of drop-frame time codes [R, 4].

    Numbers 0 and 1 of 30 (0 to 3 of 60) are left out at each minute but every tenth, so that they stay with the clock.
    """
    hours, minutes, seconds, frames = parts.T
    whole = 60 * hours + minutes
    dropped = counted // 15 * (whole - whole // 10)
    return (((60 * whole + seconds) * counted + frames) - dropped).astype(np.float64)


def _over_midnight(times_s: Floats) -> Floats:
    return times_s + DAY_S * np.cumsum(np.diff(times_s, prepend=times_s[0]) < -NOON_S)
