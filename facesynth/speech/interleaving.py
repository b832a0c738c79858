"""Where the sound of an AVI lies: it states no times, but a recorder lays sound and pictures beside each other as they come.

An AVI holds chunks of sound and of pictures; what counts as their time is how many came before. Where sound is lost nothing says
so, and all that follows is early. But pictures go on, and a chunk of sound lies in the file between two of them: between their
times, up to a delay that stays the same. Let a be the time of a chunk by its own count, and p and q those of the pictures before
and after it. Then its true time a + d lies between p and q, so that p - a <= d <= q - a. What all chunks of a stretch have in
common tells d to a few milliseconds, and where d leaps, sound was lost.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

Floats = NDArray[np.float64]
AROUND = 9
"""Chunks over whose median a leap must last."""
LEAP_S = 0.1
"""Chunks lie unevenly by as much as a recorder holds back; what leaps by less is not taken for a loss."""
MATCHING = 0.5
"""Share of what the pictures last longer than the sound that the gaps must account for, else the file is only laid unevenly."""


class Chunks(NamedTuple):
    """The chunks of a file's sound, in the order in which they lie."""

    times_s: Floats
    """[N] by the count of the sound before."""
    before_s: Floats
    """[N] time of the picture that lies before, -inf for none."""
    after_s: Floats
    """[N] time of the picture that lies after, inf for none."""
    shorter_s: float
    """By how much the sound is shorter than the pictures."""
    held_s: float = 0.0
    """By how much pictures lie before the sound of their time: what others are predicted from lies before it is shown."""


def chunks_of(path: Path) -> Chunks | None:
    """How sound and pictures lie in a file that FFmpeg opens; None where there is nothing to compare."""
    import av

    with av.open(str(path)) as container:
        if not (container.streams.audio and container.streams.video):
            return None
        sound, pictures = container.streams.audio[0], container.streams.video[0]
        found = [
            (packet.pos, packet.stream.type == "audio", float(packet.dts * packet.time_base), float(packet.duration or 0))
            for packet in container.demux([sound, pictures])
            if packet.dts is not None and packet.pos is not None and packet.size
        ]
        units = float(sound.time_base or 0), float(pictures.time_base or 0)
    heard, seen = (sorted(row for row in found if row[1] is is_sound) for is_sound in (True, False))
    if min(len(heard), len(seen)) < AROUND:
        return None
    times_s, seen_s = (np.array([row[2] for row in rows]) for rows in (heard, seen))
    ends_s = [rows[-1][2] + rows[-1][3] * unit for rows, unit in zip((heard, seen), units, strict=True)]
    places = np.searchsorted([row[0] for row in seen], [row[0] for row in heard])
    framed = np.concatenate([[-np.inf], np.maximum.accumulate(seen_s), [np.inf]])
    held_s = _held_back(path) * units[1]
    return Chunks(times_s, framed[places], framed[places + 1], ends_s[1] - ends_s[0], held_s)


def _held_back(path: Path) -> int:
    """How many more pictures must be known than the first that is shown, for others are predicted from them."""
    import av

    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        stream.thread_type = "NONE"
        for number, packet in enumerate(container.demux(stream)):
            if packet.decode():
                return number
    return 0


def lost_sound(path: Path, later_s: float) -> tuple[tuple[float, float], ...]:
    """Gaps in the sound of a file that FFmpeg opens: when, by the sound's own count, and how long, seconds.

    later_s: by how much the sound lies later than by its own count where nothing is lost. None where they do not account for
    what the sound lacks.
    """
    chunks = chunks_of(path)
    return () if chunks is None else gaps_between(chunks, later_s)


def gaps_between(chunks: Chunks, later_s: float = 0.0) -> tuple[tuple[float, float], ...]:
    """The same of chunks."""
    delays = (chunks.before_s + chunks.after_s) / 2 - chunks.times_s
    inside = np.isfinite(delays)
    if inside.sum() < AROUND:
        return ()
    smooth = median_filter(delays[inside], size=AROUND, mode="nearest")
    steps_s = np.diff(smooth)
    if steps_s.min() < -LEAP_S:
        return ()  # held back now and then: nothing is known
    starts = np.flatnonzero(steps_s > LEAP_S) + 1
    edges = [0, *starts, len(smooth)]
    chosen = np.flatnonzero(inside)
    stretches = [chosen[first:stop] for first, stop in pairwise(edges)]
    delays_s = [_delay(chunks, rows) for rows in stretches]
    usual_s = later_s + chunks.held_s
    before_s = [usual_s if delays_s[0] - usual_s > LEAP_S else delays_s[0], *delays_s[:-1]]
    begins_s = [0.0, *(float(chunks.times_s[rows[0]]) for rows in stretches[1:])]
    found = zip(begins_s, np.subtract(delays_s, before_s), strict=True)
    gaps = tuple((begin_s, float(length_s)) for begin_s, length_s in found if length_s > LEAP_S)
    total_s = sum(length_s for _, length_s in gaps)
    return gaps if abs(chunks.shorter_s - total_s) <= (1 - MATCHING) * total_s else ()


def _delay(chunks: Chunks, rows: NDArray[np.intp]) -> float:
    """What the chunks of a stretch have in common; their median where some lie unevenly."""
    low, high = (chunks.before_s - chunks.times_s)[rows], (chunks.after_s - chunks.times_s)[rows]
    return float((low.max() + high.min()) / 2 if low.max() <= high.min() else np.median((low + high) / 2))
