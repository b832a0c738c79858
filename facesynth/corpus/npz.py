"""Arrays of a motion from an NPZ file that may be damaged or a stranger's."""

from __future__ import annotations

import struct
import tokenize
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from facesynth.inference.errors import FacesynthError

LARGEST_BYTES = 2**31
ARRAYS = ("frames", "head", "eyes", "fps")
DAMAGE = (
    *(OSError, ValueError, EOFError, LookupError, TypeError, AttributeError, MemoryError, RuntimeError, ArithmeticError),
    *(SyntaxError, tokenize.TokenError, struct.error, zlib.error, zipfile.BadZipFile),
)
"""What reading a damaged archive, or a damaged array in it, can end in."""


def read_npz(path: Path) -> dict[str, Any]:
    """Those of the arrays frames, head, eyes and the number fps that a file holds; it must hold frames. Never unpickles."""
    if not path.is_file():
        raise FacesynthError(f"{path} is missing")
    require_modest(path)
    try:
        with open(path, "rb") as file, np.load(file, allow_pickle=False) as stored:
            arrays: dict[str, Any] = {name: stored[name] for name in ARRAYS if name in stored}
    except DAMAGE as error:
        raise FacesynthError(f"{path} is not a motion file, or is damaged ({error}); write it again with numpy.savez") from None
    if "frames" not in arrays:
        raise FacesynthError(f"{path} holds no array 'frames'; write it with numpy.savez(file, frames=…, fps=…)")
    if "fps" in arrays:
        arrays["fps"] = _number(path, arrays["fps"])
    return arrays


def require_modest(path: Path) -> None:
    """FacesynthError for an archive that would unpack to more than one recording can be; what is no archive passes."""
    try:
        with zipfile.ZipFile(path) as archive:
            size = sum(entry.file_size for entry in archive.infolist())
    except DAMAGE:
        return
    if size > LARGEST_BYTES:
        raise FacesynthError(f"{path} would unpack to {size / 1e9:.1f} GB, more than one recording can be; split it")


def _number(path: Path, value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        raise FacesynthError(f"{path}: fps must be one number; got an array of shape {np.shape(value)}") from None
