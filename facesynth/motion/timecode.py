"""Frame rates of film and television, and time as hours, minutes, seconds and frames."""

import math


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
