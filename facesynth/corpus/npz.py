"""The arrays of one recording's motion."""

from pathlib import Path
from typing import Any

import numpy as np

from facesynth.inference.errors import FacesynthError
from facesynth.inference.npz import read_arrays

_WHAT = "a motion file (numpy.savez(file, frames=…, fps=…))"


def read_npz(path: Path) -> dict[str, Any]:
    """Those of the arrays frames, head, eyes and the number fps that a file holds; it must hold frames."""
    arrays: dict[str, Any] = read_arrays(path, _WHAT, ["frames"], ["head", "eyes", "fps"])
    if "fps" in arrays:
        arrays["fps"] = _number(path, arrays["fps"])
    return arrays


def _number(path: Path, value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        raise FacesynthError(f"{path}: fps must be one number; got an array of shape {np.shape(value)}") from None
