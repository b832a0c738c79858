"""Frame rates of film and television, and time as hours, minutes, seconds and frames."""

from __future__ import annotations

import math
import re

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.errors import FacesynthError

_TIMECODE = re.compile(r"(\d{1,3}):([0-5]\d):([0-5]\d):(\d{2,3})(\.\d+)?")


def exact_fps(fps: float) -> float:
    """23.976, 29.97, 59.94, … as the exact rate that they stand for, 24000/1001, 30000/1001, …; others unchanged.

    >>> exact_fps(29.97) * 1001
    30000.0
    """
    exact = math.ceil(fps) * 1000 / 1001
    return exact if abs(fps - exact) < 0.002 else float(fps)


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


def parse_timecodes(texts: list[str]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Whole seconds since midnight [T, as float] and frame of each timecode, the fraction in `seconds` left out.

    Returns (frames [T] with their fraction, seconds [T]).
    """
    frames, seconds = np.empty(len(texts)), np.empty(len(texts), np.int64)
    for i, text in enumerate(texts):
        match = _TIMECODE.fullmatch(text.strip())
        if match is None:
            raise FacesynthError(f"row {i + 2}: {text[:40]!r} is no timecode; wanted HH:MM:SS:FF.mmm")
        hours, minutes, second, frame = (int(group) for group in match.groups()[:4])
        seconds[i] = hours * 3600 + minutes * 60 + second
        frames[i] = frame + float(match.group(5) or 0)
    return frames, seconds


def rate_of(frames: NDArray[np.float64], seconds: NDArray[np.int64]) -> int | None:
    """Frames that the timecodes count in a second, or None where the take is too short to tell.

    The highest frame number counted before a second is over is one less than the rate. Rates below
    that of film are not looked for: a take of half a second has such low numbers too.
    """
    highest = int(frames.max()) + 1
    return highest if len(np.unique(seconds)) > 1 and highest >= 23 else None
