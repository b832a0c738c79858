"""What OpenFace sees of a face in a video: 68 landmarks, head and gaze, a row a picture."""

import csv
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from facesynth.corpus.importers.reading import Reading, motion_of_arrays, require_file
from facesynth.corpus.importers.timed import at_steady_rate
from facesynth.encoding import text_of
from facesynth.inference.arrays import Floats
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Kind, Layout
from facesynth.motion.cells import read_cells, separator_of, without_preamble

CONFIDENT = 0.5
"""A face is found where OpenFace is so sure of it, in tables that do not say so otherwise."""
MOST_BEFORE = 10**6
POINTS = 68
LONGEST_HEADER = 1 << 15
"""Bytes of its 714 names of columns are fewer."""
GROUPS = {
    "jaw": (6, 7, 8, 9, 10),
    "brows": tuple(range(17, 27)),
    "nose": tuple(range(27, 36)),
    "eyelids": tuple(range(36, 48)),
    "mouth": tuple(range(48, 68)),
    "lips_inner": tuple(range(60, 68)),
    "upper_lip": (49, 50, 51, 52, 53, 61, 62, 63),
    "lower_lip": (55, 56, 57, 58, 59, 65, 66, 67),
    "rigid": (27, 28, 29, 30, 36, 39, 42, 45),
}
"""Of the 68 points of iBUG."""
LIP_PAIRS = ((61, 67), (62, 66), (63, 65))
OUR_AXES = np.array([1.0, -1.0, -1.0])
"""Signs from a camera's axes (right, down, away) to ours; its right is the performer's left."""
FULL_BLINK = 5.0
"""Of action unit 45."""


def is_openface(path: Path) -> bool:
    """Whether a table has OpenFace's columns."""
    try:
        first = without_preamble(text_of(path, LONGEST_HEADER)).partition("\n")[0]
        names = {_plain(name) for name in next(csv.reader([first], delimiter=separator_of(first)), [])}
    except (OSError, UnicodeDecodeError, csv.Error):
        return False
    return {"frame"} <= names and bool({"timestamp", "success", "confidence"} & names) and bool({"X_0", "x_0"} & names)


def read_openface(path: Path, fps: float | None = None) -> Reading:
    """Landmarks without the head's motion (mm in 3-D; else px in 2-D), head and gaze; NaN where OpenFace had no success.

    Of several faces that with most successful rows is taken, and those that are never seen beside it. Time begins with the
    video. fps: its rate, if the rows have no times.
    """
    require_file(path)
    given, table = read_cells(path)
    columns = [_plain(name) for name in given]
    seen, doubts = _successes(path, columns, table)
    times_s, counted = _times_s(path, columns, table, fps)
    kept, remarks = _one_face(columns, table, seen, times_s)
    table, seen, times_s = table[kept], seen[kept], times_s[kept]
    is_3d = _has(columns, _names("X", "Y", "Z"))
    points = _points(path, columns, table, ("X", "Y", "Z") if is_3d else ("x", "y"))
    head, eyes = _head(columns, table), _eyes(columns, table)
    if is_3d and head is not None:
        points = (
            Rotation.from_rotvec(head[:, None, :3].repeat(POINTS, axis=1).reshape(-1, 3))
            .inv()
            .apply((points - head[:, None, 3:]).reshape(-1, 3))
            .reshape(points.shape)
        )
    parts = [points.reshape(len(points), -1), *(part for part in (head, eyes) if part is not None)]
    signal = np.where(seen[:, None], np.concatenate(parts, axis=1), np.nan)
    frames, rate, said = at_steady_rate(path, *_from_zero(signal, times_s))
    if lost := np.count_nonzero(~seen):
        remarks.append(f"OpenFace had no success in {lost} of {len(seen)} pictures: they are gaps")
    width = parts[0].shape[1]
    own_head = frames[:, width : width + 6] if head is not None else None
    kind: Kind = "markers" if is_3d else "landmarks"
    layout = Layout(kind, tuple(f"landmark_{k}" for k in range(POINTS)), GROUPS, LIP_PAIRS)
    motion = motion_of_arrays(path, frames[:, :width], rate, layout, own_head, frames[:, -3:] if eyes is not None else None)
    return Reading(motion, remarks=(*doubts, *counted, *remarks, *said))


def _plain(name: str) -> str:
    """A name of a column without spaces, quotes and capitals; X is another axis than x."""
    bare = name.strip().strip('"\ufeff').strip()
    return bare if re.fullmatch(r"[xyzXYZ]_\d+|AU\d\d_[rc]|pose_[TR][xyz]", bare) else bare.lower()


def _successes(path: Path, columns: list[str], table: Floats) -> tuple[NDArray[np.bool_], tuple[str, ...]]:
    """[R] whether OpenFace found the face, and what was assumed."""
    if "success" in columns:
        return table[:, columns.index("success")] == 1, ()
    if "confidence" in columns:
        said = f"it has no column of success: rows of a confidence of {CONFIDENT:g} and more are taken"
        return table[:, columns.index("confidence")] >= CONFIDENT, (said,)
    return np.ones(len(table), bool), ("it has no columns of success and confidence: all rows are taken",)


def _times_s(path: Path, columns: list[str], table: Floats, fps: float | None) -> tuple[Floats, tuple[str, ...]]:
    """[R] seconds of each row: by its time, else by its number of a frame at a stated rate."""
    times_s = table[:, columns.index("timestamp")] if "timestamp" in columns else np.zeros(len(table))
    if np.ptp(times_s) > 0 or len(table) < 2:
        return times_s, ()
    if fps is None:
        raise FacesynthError(f"{path} has no times, as OpenFace writes of pictures; give their rate (--fps)")
    numbers = table[:, columns.index("frame")]
    return (numbers - min(1.0, float(numbers.min()))) / fps, (f"it has no times: its frames stand at the stated {fps:g} fps",)


def _one_face(columns: list[str], table: Floats, seen: NDArray[np.bool_], times_s: Floats) -> tuple[NDArray[np.bool_], list[str]]:
    """[R] the rows of one face, and what a person should know."""
    everybody = np.ones(len(table), bool)
    if "face_id" not in columns or not len(table):
        return everybody, []
    faces = table[:, columns.index("face_id")]
    known = sorted(np.unique(faces), key=lambda face: -np.count_nonzero(seen & (faces == face)))
    if len(known) < 2:
        return everybody, []
    kept, joined = faces == known[0], [f"{known[0]:g}"]
    for face in known[1:]:
        if not np.isin(times_s[faces == face], times_s[kept]).any():
            kept, joined = kept | (faces == face), [*joined, f"{face:g}"]
    said = f"{len(known)} faces are in it: face_id {joined[0]} was taken, which is seen most"
    more = f", and {', '.join(joined[1:])}, never seen beside it, as the same face found again" if joined[1:] else ""
    return kept, [said + more]


def _from_zero(signal: Floats, times_s: Floats) -> tuple[Floats, Floats]:
    """Frames and times that begin with the video: where the face appears later, a gap stands before it."""
    usual_s = float(np.median(np.diff(times_s))) if len(times_s) > 1 else 0.0
    before = round(times_s[0] / usual_s) if usual_s > 0 and times_s[0] > 0 else 0
    if not 0 < before <= MOST_BEFORE:
        return signal, times_s
    early_s = times_s[0] - usual_s * np.arange(before, 0, -1)
    return np.concatenate([np.full((before, signal.shape[1]), np.nan), signal]), np.concatenate([early_s, times_s])


def _names(*axes: str) -> list[str]:
    return [f"{axis}_{k}" for axis in axes for k in range(POINTS)]


def _has(columns: list[str], names: list[str]) -> bool:
    return set(names) <= set(columns)


def _picked(columns: list[str], table: Floats, names: list[str]) -> Floats:
    return table[:, [columns.index(name) for name in names]]


def _points(path: Path, columns: list[str], table: Floats, axes: tuple[str, ...]) -> Floats:
    """[T, 68, D] with our axes; in pictures y points down, in a layout up."""
    if not _has(columns, _names(*axes)):
        raise FacesynthError(f"{path} lacks some of OpenFace's {POINTS} landmarks; run it with -2Dfp or -3Dfp")
    points = _picked(columns, table, _names(*axes)).reshape(len(table), len(axes), POINTS).transpose(0, 2, 1)
    return points * OUR_AXES[: len(axes)]


def _head(columns: list[str], table: Floats) -> Floats | None:
    """[T, 6] rotation vector and translation in our axes. OpenFace turns by Rx Ry Rz."""
    names = [f"pose_{what}{axis}" for what in "TR" for axis in "xyz"]
    if not _has(columns, names):
        return None
    pose = np.nan_to_num(_picked(columns, table, names))
    turns = Rotation.from_euler("XYZ", pose[:, 3:]).as_rotvec() * OUR_AXES
    return np.concatenate([turns, pose[:, :3] * OUR_AXES], axis=1)


def _eyes(columns: list[str], table: Floats) -> Floats | None:
    """[T, 3] opening, gaze to the performer's left and up."""
    if not _has(columns, ["gaze_angle_x", "gaze_angle_y"]):
        return None
    gaze = _picked(columns, table, ["gaze_angle_x", "gaze_angle_y"]) * OUR_AXES[:2]
    shut = _picked(columns, table, ["AU45_r"])[:, 0] / FULL_BLINK if "AU45_r" in columns else np.zeros(len(table))
    return np.column_stack([1 - np.clip(shut, 0, 1), gaze])
