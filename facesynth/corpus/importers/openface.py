"""What OpenFace sees of a face in a video: 68 landmarks, head and gaze, a row a picture."""

import csv
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from facesynth.corpus.importers.reading import Reading, motion_of_arrays, require_file
from facesynth.corpus.importers.timed import at_steady_rate
from facesynth.encoding import text_of
from facesynth.inference.arrays import Floats
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Kind, Layout
from facesynth.motion.cells import read_cells

FIRST = ("frame", "timestamp", "success")
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
        first = text_of(path, LONGEST_HEADER).partition("\n")[0]
        names = {name.strip() for name in next(csv.reader([first]), [])}
    except (OSError, UnicodeDecodeError, csv.Error):
        return False
    return set(FIRST) <= names and ("X_0" in names or "x_0" in names)


def read_openface(path: Path) -> Reading:
    """Landmarks without the head's motion (mm in 3-D; else px in 2-D), head and gaze; NaN where OpenFace had no success.

    Of several faces that with most successful rows is taken.
    """
    require_file(path)
    columns, table = read_cells(path)
    table, remarks = _one_face(path, columns, table)
    seen = table[:, columns.index("success")] == 1
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
    frames, fps, said = at_steady_rate(path, signal, table[:, columns.index("timestamp")])
    if lost := np.count_nonzero(~seen):
        remarks.append(f"OpenFace had no success in {lost} of {len(seen)} pictures: they are gaps")
    width = parts[0].shape[1]
    own_head = frames[:, width : width + 6] if head is not None else None
    kind: Kind = "markers" if is_3d else "landmarks"
    layout = Layout(kind, tuple(f"landmark_{k}" for k in range(POINTS)), GROUPS, LIP_PAIRS)
    motion = motion_of_arrays(path, frames[:, :width], fps, layout, own_head, frames[:, -3:] if eyes is not None else None)
    return Reading(motion, remarks=(*remarks, *said))


def _one_face(path: Path, columns: list[str], table: Floats) -> tuple[Floats, list[str]]:
    if "face_id" not in columns or not len(table):
        return table, []
    faces = table[:, columns.index("face_id")]
    seen = table[:, columns.index("success")] == 1
    known = np.unique(faces)
    best = max(known, key=lambda face: np.count_nonzero(seen & (faces == face)))
    said = [f"{len(known)} faces are in it: face_id {best:g} was taken, which is seen most"] if len(known) > 1 else []
    return table[faces == best], said


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
