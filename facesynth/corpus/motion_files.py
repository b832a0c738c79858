"""Motion as other programs write it: NPZ and CSV, of any rate, with or without the head's motion in it."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus.npz import read_npz
from facesynth.errors import FacesynthError, unknown
from facesynth.motion.layout import Layout
from facesynth.motion.motion import Motion
from facesynth.motion.pose import remove_head, rigid_points
from facesynth.motion.resample import resample

AXES = ("x", "y", "z")
TIME = "time_s"
ROUNDING_S = 0.001
USUAL_FPS = (24000 / 1001, 24, 25, 30000 / 1001, 30, 48, 50, 60000 / 1001, 60, 90, 100, 120, 150, 200, 240)
"""Rates of cameras and capture systems, Hz."""


def load_motion(path: str | Path, layout: Layout, fps: float) -> tuple[Motion, tuple[str, ...]]:
    """Motion from a file in the corpus' layout and at its rate, the head's motion taken out; and what was done to it.

    NPZ: frames [T, K, dimension] or [T, C], and if there are any fps, head [T, 6], eyes [T, 3]. CSV: a column for each
    channel (`chin.x`, `chin.y`, …, or a curve's name), empty cells where a sample is missing, and if there is one
    `time_s`. Where nothing states the file's rate it is the corpus' own. Head motion is taken out where the file does
    not hold it separately and the layout says which points are rigid.
    """
    path = Path(path)
    arrays = _from_csv(path, layout, fps) if path.suffix.lower() == ".csv" else read_npz(path)
    remarks = list(arrays.pop("remarks", ()))
    file_fps = arrays.get("fps", fps)
    try:
        motion = Motion(_flat(arrays["frames"], layout), file_fps, layout, arrays.get("head"), arrays.get("eyes"))
    except ValueError as error:
        raise FacesynthError(f"{path}: {error}") from None
    if not len(motion) or np.isinf(motion.frames).any():
        raise FacesynthError(f"{path} holds no frames, or infinite values; export it again")
    motion, remark = _without_head(motion)
    remarks += [remark] * bool(remark)
    if not np.isclose(file_fps, fps, rtol=1e-6):
        remarks.append(f"resampled from {file_fps:g} to {fps:g} fps")
        motion = resample(motion, fps)
    return Motion(motion.frames, fps, layout, motion.head, motion.eyes), tuple(remarks)


def channel_names(layout: Layout) -> tuple[str, ...]:
    """Names of the C channels: `chin.x`, … for points, the curve's own name for curves."""
    if layout.dimension == 1:
        return layout.names
    return tuple(f"{name}.{axis}" for name in layout.names for axis in AXES[: layout.dimension])


def own_rate(path: str | Path) -> float:
    """The rate, Hz, of a CSV with the column `time_s`."""
    columns, table = _table(Path(path))
    if TIME not in columns:
        raise FacesynthError(f"{path} has no column {TIME}, so its rate is not known")
    times_s = table[:, columns.index(TIME)]
    span_s = float(times_s[-1] - times_s[0]) if len(times_s) > 1 else 0.0
    if not span_s > 0:
        raise FacesynthError(f"{path}: the column {TIME} does not go up; resample the motion first")
    return _rate(Path(path), times_s, (len(times_s) - 1) / span_s)


def _from_csv(path: Path, layout: Layout, fps: float) -> dict[str, Any]:
    columns, table = _table(path)
    wanted = channel_names(layout)
    for channel in wanted:
        if channel not in columns:
            raise FacesynthError(f"{path} lacks a column: {unknown('column', channel, columns)}")
    others = [column for column in columns if column not in wanted and column != TIME]
    remarks = [f"columns that the layout does not have were left out: {', '.join(others)}"] if others else []
    arrays: dict[str, Any] = {"frames": table[:, [columns.index(channel) for channel in wanted]], "remarks": remarks}
    if TIME in columns:
        arrays["fps"] = _rate(path, table[:, columns.index(TIME)], fps)
    return arrays


def _table(path: Path) -> tuple[list[str], NDArray[np.float64]]:
    """Names of the columns, and the numbers [T, columns]; NaN for empty cells."""
    try:
        with open(path, encoding="utf-8-sig", newline="") as file:
            columns, *rows = [[cell.strip() for cell in row] for row in csv.reader(file) if row] or [[]]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FacesynthError(f"{path} cannot be read as CSV in UTF-8 ({error}); export it again") from None
    for number, row in enumerate(rows, start=2):
        if len(row) != len(columns):
            raise FacesynthError(f"{path}, line {number}: {len(row)} cells, but {len(columns)} columns")
    try:
        table = np.array([[float(cell or "nan") for cell in row] for row in rows])
    except ValueError as error:
        raise FacesynthError(f"{path}: {error}; wanted numbers below the names of the columns") from None
    return columns, table.reshape(len(rows), len(columns))


def _rate(path: Path, times_s: NDArray[np.float64], fps: float) -> float:
    """The rate of times that may be rounded to milliseconds: the corpus' own if it can be, else a usual one, else their mean."""
    steps = np.diff(times_s)
    if not len(steps) or not (steps > 0).all() or np.abs(steps - steps.mean()).max() > 0.5 * steps.mean():
        raise FacesynthError(f"{path}: the column {TIME} does not go up in even steps; resample the motion first")
    mean = float(1 / steps.mean())
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
    points, head = remove_head(motion.points, neutral, rigid_points(layout))
    if np.isnan(head).all():
        return motion, "head motion was left in: no frame has three rigid points"
    return Motion(points.reshape(motion.frames.shape), motion.fps, layout, head, motion.eyes), ""
