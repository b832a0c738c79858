"""BEAT2: FLAME's pose over time, of which head, eyes and the opening of the jaw are used."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from facesynth.corpus.importers.reading import Reading, motion_of_arrays
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout

WIDE_RAD = np.radians(30)
"""A jaw that is turned so far is wide open: weight 1."""
LAYOUT = Layout("curves", ("jawOpen",))
TURNS = ("jaw", "head", "neck", "left_eye", "right_eye")


def is_flame(arrays: dict[str, NDArray[Any]]) -> bool:
    """Whether arrays are FLAME's pose."""
    return set(TURNS) <= set(arrays)


def read_flame(path: Path, arrays: dict[str, NDArray[Any]]) -> Reading:
    """Head (neck and head together), gaze and jaw; FLAME's axes are those of this project.

    FLAME's expression coefficients mean nothing without FLAME, and it has no blinks: both are left out.
    """
    count = len(arrays["jaw"])
    if any(arrays[name].shape != (count, 3) or not np.isfinite(arrays[name]).all() for name in TURNS) or not count:
        raise FacesynthError(f"{path}: wanted rotation vectors [T, 3] of {', '.join(TURNS)}; export it again")
    head = Rotation.from_rotvec(arrays["neck"]) * Rotation.from_rotvec(arrays["head"])
    gaze = np.mean([_gaze(arrays[name]) for name in ("left_eye", "right_eye")], axis=0)
    frames = np.clip(arrays["jaw"][:, :1] / WIDE_RAD, 0, 1)
    fps = float(arrays["fps"].ravel()[0]) if arrays.get("fps", np.zeros(0)).size == 1 else 30.0
    poses = np.concatenate([head.as_rotvec(), np.zeros((count, 3))], axis=1)
    eyes = np.column_stack([np.ones(count), gaze])
    remarks = ("FLAME's expressions were left out; head, gaze and the opening of the jaw are used",)
    return Reading(motion_of_arrays(path, frames, fps, LAYOUT, poses, eyes), remarks=remarks)


def _gaze(turns: NDArray[Any]) -> NDArray[np.float64]:
    """[T, 2] angles to the left and up of an eye that looks along z when not turned."""
    x, y, z = Rotation.from_rotvec(turns).apply([0.0, 0.0, 1.0]).T
    return np.column_stack([np.arctan2(x, z), np.arctan2(y, np.hypot(x, z))])
