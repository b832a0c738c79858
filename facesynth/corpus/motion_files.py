"""Motion as other programs write it: NPZ and CSV, of any rate, with or without the head's motion in it."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus.importers.description import Written
from facesynth.corpus.importers.timed import at_steady_rate
from facesynth.corpus.npz import read_npz
from facesynth.inference.errors import FacesynthError, unknown
from facesynth.inference.layout import Layout
from facesynth.inference.long_arrays import Growing, by_blocks, row_blocks
from facesynth.inference.motion import Motion
from facesynth.motion.cells import read_cells
from facesynth.motion.irregular import USUAL_FPS
from facesynth.motion.pose import remove_head, rigid_points
from facesynth.motion.resample import resample

AXES = ("x", "y", "z")
TIME = "time_s"
TIMES = frozenset({TIME, "time", "seconds", "timestamp_s", "timestamp", "time_ms", "timestamp_ms", "time_seconds"})
"""Columns of times, in lower case and with `_` for all other signs (`Time (s)`); those that end in ms hold milliseconds."""
NUMBERS = frozenset({"frame", "frames", "frame_number", "frame_no", "frame_id", "frame_index"})
"""Columns that count frames, in the same spelling."""
LARGEST_GAP = 50
"""Frames for each row: a column of numbers with larger gaps counts something else."""
ROUNDING_S = 0.001
SAME_RATE = 1e-6


def load_motion(path: str | Path, layout: Layout, fps: float, written: Written | None = None) -> tuple[Motion, tuple[str, ...]]:
    """Motion from a file in the corpus' layout and at its rate, the head's motion taken out; and what was done to it.

    NPZ: frames [T, K, dimension] or [T, C], and if there are any fps, head [T, 6], eyes [T, 3]. CSV: a column for each
    channel (`chin.x`, `chin.y`, …, or a curve's name), empty cells where a sample is missing, and if there is one
    `time_s`. Where nothing states the file's rate it is the corpus' own. Head motion is taken out where the file does
    not hold it separately and the layout says which points are rigid. written: how a CSV is written.
    """
    path = Path(path)
    if path.suffix.lower() == ".csv":
        motion, remarks = read_csv(path, layout, fps, written)
    else:
        arrays = read_npz(path)
        try:
            file_fps = arrays.get("fps", fps)
            motion = Motion(_flat(arrays["frames"], layout), file_fps, layout, arrays.get("head"), arrays.get("eyes"))
        except ValueError as error:
            raise FacesynthError(f"{path}: {error}") from None
        remarks = ()
    if not len(motion) or any(np.isinf(motion.frames[rows]).any() for rows in row_blocks(motion.frames)):
        raise FacesynthError(f"{path} holds no frames, or infinite values; export it again")
    fitted, more = into_corpus(motion, layout, fps)
    return fitted, (*remarks, *more)


def into_corpus(motion: Motion, layout: Layout, fps: float) -> tuple[Motion, tuple[str, ...]]:
    """A motion with the same points or curves in the corpus' layout and at its rate, the head's motion taken out."""
    motion, said = with_points_of(layout, motion)
    remarks = list(said)
    motion, remark = _without_head(motion)
    remarks += [remark] * bool(remark)
    if not np.isclose(motion.fps, fps, rtol=1e-6):
        remarks.append(f"resampled from {motion.fps:g} to {fps:g} fps")
        motion = resample(motion, fps)
    return Motion(motion.frames, fps, layout, motion.head, motion.eyes), tuple(remarks)


def with_points_of(layout: Layout, motion: Motion) -> tuple[Motion, tuple[str, ...]]:
    """A motion with the points or curves of a layout, found by name, in its order; FacesynthError where it lacks some."""
    own = motion.layout
    if own.kind != layout.kind:
        raise FacesynthError(f"it holds {own.kind}, not {layout.kind}; those need a corpus of their own")
    places = {name: number for number, name in enumerate(own.names)}
    lacking = [name for name in layout.names if name not in places]
    if lacking:
        near = unknown(layout.kind.rstrip("s"), lacking[0], own.names)
        raise FacesynthError(f"{len(lacking)} of the {len(layout.names)} {layout.kind} wanted are not in it: {near}")
    left = len(own.names) - len(layout.names)
    remarks = (f"{left} {own.kind} that the corpus does not have were left out",) if left else ()
    if own.names == layout.names:
        return replace(motion, layout=layout), remarks
    wanted = [places[name] for name in layout.names]
    frames = by_blocks(lambda some: own.points(some)[:, wanted].reshape(len(some), -1), motion.frames)
    return Motion(frames, motion.fps, layout, motion.head, motion.eyes), remarks


def channel_names(layout: Layout) -> tuple[str, ...]:
    """Names of the C channels: `chin.x`, … for points, the curve's own name for curves."""
    if layout.dimension == 1:
        return layout.names
    return tuple(f"{name}.{axis}" for name in layout.names for axis in AXES[: layout.dimension])


def read_csv(
    path: Path, layout: Layout, fps: float, written: Written | None = None, *, only_own_rate: bool = False
) -> tuple[Motion, tuple[str, ...]]:
    """Motion [T, C] of a CSV in a layout, head motion still in, and what was noticed.

    Columns are found by name, whatever signs join point and axis; without names they are taken in order. The rate is
    that of the column of times, else `fps`. only_own_rate: a FacesynthError where there are no times.
    """
    written = written or Written()
    columns, table = read_cells(path, written.separator, written.decimal)
    wanted = channel_names(layout)
    remarks: list[str] = []
    if written.columns:
        places, time = written.picked_from(table.shape[1]), time_column(columns, written, wanted) if columns else None
        if len(places) != len(wanted):
            raise FacesynthError(f"{path}: {len(places)} columns are picked; the layout has {len(wanted)} channels")
    elif not columns and len(table) and table.shape[1] == len(wanted):
        places, time = list(range(len(wanted))), None
        remarks = ["the columns have no names; they were taken in the layout's order"]
    else:
        time = time_column(columns, written, wanted)
        places = [_column(path, channel, columns) for channel in wanted]
        others = [name for k, name in enumerate(columns) if k not in places and name != time]
        remarks = [f"columns that the layout does not have were left out: {shortened(others)}"] if others else []
    if time is None and only_own_rate:
        raise FacesynthError(f"{path} does not state its rate: give it (--fps), or a column {TIME}")
    frames: NDArray[np.floating] = table[:, places]
    if time is not None:
        times_s = table[:, columns.index(time)] * (0.001 if _words(time).endswith("ms") else 1.0)
        frames, fps, said = _at_times(path, frames, times_s, fps)
        remarks += said
    elif (number := number_column(columns, wanted)) is not None:
        frames, said = _at_numbers(frames, table[:, columns.index(number)])
        remarks += said
    if layout.dimension > 1:
        frames = written.placed(layout.points(frames)).reshape(frames.shape)
    try:
        return Motion(frames.astype(np.float32), fps, layout), tuple(remarks)
    except ValueError as error:
        raise FacesynthError(f"{path}: {error}") from None


def time_column(columns: Sequence[str], written: Written, channels: Sequence[str] = ()) -> str | None:
    """The column that holds times: the one that was named, else one of a usual name that is no channel."""
    if written.time:
        if written.time not in columns:
            raise unknown("column of times", written.time, columns)
        return written.time
    return next((name for name in columns if _words(name) in TIMES and name not in channels), None)


def number_column(columns: Sequence[str], channels: Sequence[str] = ()) -> str | None:
    """The column that counts frames, if there is one that is no channel."""
    return next((name for name in columns if _words(name) in NUMBERS and name not in channels), None)


def _words(name: str) -> str:
    """A column's name in lower case, with `_` for all signs that are no letters."""
    return re.sub(r"[^a-z]+", "_", name.lower()).strip("_")


def shortened(names: Sequence[str], most: int = 5) -> str:
    """The first names of a list, and how many there are beyond."""
    shown = ", ".join(name if len(name) <= 40 else f"{name[:40]}…" for name in names[:most])
    return shown + (f" and {len(names) - most} more" if len(names) > most else "")


def _column(path: Path, channel: str, columns: Sequence[str]) -> int:
    """The column of a channel: by its name, else by its letters and digits alone, if that is clear."""
    if channel in columns:
        return columns.index(channel)
    like = [k for k, name in enumerate(columns) if _plain(name) == _plain(channel)]
    if len(like) == 1:
        return like[0]
    if not columns:
        raise FacesynthError(f"{path} lacks a column: unknown column {channel!r}; its first line does not name the columns")
    raise FacesynthError(f"{path} lacks a column: {unknown('column', channel, [name[:40] for name in columns])}")


def _plain(name: str) -> str:
    return "".join(letter for letter in name.lower() if letter.isalnum())


def _at_times(
    path: Path, frames: NDArray[np.floating], times_s: NDArray[np.float64], fps: float
) -> tuple[NDArray[np.floating], float, tuple[str, ...]]:
    """Frames [T, C] at a steady rate, that rate, and what was done: lost rows leave gaps, doubled ones are read once."""
    steps = np.diff(times_s)
    if len(steps) and (steps > 0).all() and np.abs(steps - steps.mean()).max() <= 0.5 * steps.mean():
        return frames, _rate(times_s, fps), ()
    placed, rate, said = at_steady_rate(path, frames, times_s)
    return placed, fps if abs(fps / rate - 1) < SAME_RATE else rate, said


def _at_numbers(frames: NDArray[np.floating], numbers: NDArray[np.float64]) -> tuple[NDArray[np.floating], tuple[str, ...]]:
    """Frames [T, C] where their numbers say, NaN for those that are missing; as they are where the numbers count otherwise."""
    steps = np.diff(numbers)
    if not len(steps) or not (steps > 0).all() or (steps % steps.min() != 0).any() or (steps == steps.min()).all():
        return frames, ()
    places = ((numbers - numbers[0]) / steps.min()).astype(np.int64)
    count = int(places[-1]) + 1
    if count > LARGEST_GAP * len(frames):
        return frames, ()
    placed = np.full((count, frames.shape[1]), np.nan)
    placed[places] = frames
    return placed, (f"{count - len(frames)} of {count} frames have no row by their numbers: they are gaps",)


def _rate(times_s: NDArray[np.float64], fps: float) -> float:
    """The rate of times that may be rounded to milliseconds: the corpus' own if it can be, else a usual one, else their mean."""
    mean = float(1 / np.diff(times_s).mean())
    for rate in (fps, *sorted(USUAL_FPS, key=lambda rate: abs(rate - mean))):
        if np.abs(times_s - times_s[0] - np.arange(len(times_s)) / rate).max() <= ROUNDING_S:
            return float(rate)
    return mean


def _flat(frames: NDArray[Any], layout: Layout) -> NDArray[Any]:
    """[T, K, dimension] or [T, C] → [T, C]; anything else stays, for Motion to refuse."""
    if frames.ndim == 3 and frames.shape[1:] == (len(layout.names), layout.dimension):
        return frames.reshape(len(frames), -1)
    return frames


def _without_head(motion: Motion) -> tuple[Motion, str]:
    layout = motion.layout
    if layout.kind != "markers" or motion.head is not None:
        return motion, ""
    if layout.neutral is None or "rigid" not in layout.groups:
        return motion, "head motion was left in: the layout has no neutral pose or no group 'rigid' to measure it on"
    neutral = np.reshape(np.array(layout.neutral), (-1, 3))
    frames, heads = Growing(), Growing()
    for rows in row_blocks(motion.frames):
        points, head = remove_head(motion.points[rows], neutral, rigid_points(layout))
        frames.add(points.reshape(len(points), -1))
        heads.add(head)
    whole_head = heads.whole()
    if np.isnan(whole_head).all():
        return motion, "head motion was left in: no frame has three rigid points"
    return Motion(frames.whole(), motion.fps, layout, whole_head, motion.eyes), ""
