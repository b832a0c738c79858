"""Arrays of a motion from an NPZ file that may be damaged or a stranger's."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from facesynth.errors import FacesynthError

ARRAYS = ("frames", "head", "eyes", "fps")


def read_npz(path: Path) -> dict[str, Any]:
    """Those of the arrays frames, head, eyes and the number fps that a file holds; it must hold frames. Never unpickles."""
    if not path.is_file():
        raise FacesynthError(f"{path} is missing")
    try:
        with open(path, "rb") as file, np.load(file, allow_pickle=False) as stored:
            arrays: dict[str, Any] = {name: stored[name] for name in ARRAYS if name in stored}
    except (OSError, ValueError, EOFError, KeyError, TypeError, AttributeError, zipfile.BadZipFile) as error:
        raise FacesynthError(f"{path} is not a motion file, or is damaged ({error}); write it again with numpy.savez") from None
    if "frames" not in arrays:
        raise FacesynthError(f"{path} holds no array 'frames'; write it with numpy.savez(file, frames=…, fps=…)")
    if "fps" in arrays:
        arrays["fps"] = _number(path, arrays["fps"])
    return arrays


def _number(path: Path, value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        raise FacesynthError(f"{path}: fps must be one number; got an array of shape {np.shape(value)}") from None
