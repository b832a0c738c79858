"""CSV, NPZ and MAT of any points or curves, with a layout that names them; and weights with a list of their names."""

from __future__ import annotations

import csv
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus.importers.reading import Reading, motion_of_arrays, require_file
from facesynth.corpus.motion_files import TIME, load_motion, own_rate
from facesynth.corpus.npz import require_modest
from facesynth.errors import FacesynthError
from facesynth.motion.layout import Layout

CHANNELS = "channels.txt"
"""Beside weights: the names of the columns, one a line."""
FRAMES = ("frames", "weights", "points", "data", "signal")
POINTS = (".x", ".y", ".z")
"""How the columns of points end: those need a layout."""
RATES = ("fps", "rate", "srate", "framerate")


def read_channels(path: Path) -> Layout:
    """Curves named in a text file, one a line."""
    try:
        names = [line.strip() for line in path.read_text(encoding="utf-8-sig").splitlines() if line.strip()]
    except (OSError, UnicodeDecodeError) as error:
        raise FacesynthError(f"{path} cannot be read as a list of names in UTF-8 ({error})") from None
    return Layout("curves", tuple(names))


def read_table(path: Path, layout: Layout | None, fps: float | None) -> Reading:
    """Motion [T, C] or [T, K, dimension] under any usual name in a CSV, NPZ or MAT.

    The layout is the given one, else that of `channels.txt` in the same folder, else curves as the file
    names them; the rate is the file's own, else `fps`.
    """
    require_file(path)
    if layout is None:
        beside = path.with_name(CHANNELS)
        layout = read_channels(beside) if beside.is_file() else _self_named(path)
    if path.suffix.lower() == ".csv":
        timed = TIME in _columns(path)
        if fps is None and not timed:
            raise FacesynthError(f"{path} does not state its rate: give it, or a column {TIME}")
        motion, remarks = load_motion(path, layout, fps or own_rate(path))
        return Reading(motion, remarks=remarks)
    arrays = _npz(path) if path.suffix.lower() == ".npz" else _mat(path)
    frames = _named(arrays, FRAMES)
    rate = _named(arrays, RATES)
    known = float(rate.ravel()[0]) if rate is not None and rate.size == 1 else fps
    if frames is None or known is None:
        lacking = f"none of {', '.join(FRAMES)}" if frames is None else "no rate (fps)"
        raise FacesynthError(
            f"{path} holds {', '.join(arrays) or 'nothing'}, but {lacking}; name the arrays so, or give the rate"
        )
    if frames.ndim == 3 and frames.shape[1:] == (len(layout.names), layout.dimension):
        frames = frames.reshape(len(frames), -1)
    return Reading(motion_of_arrays(path, frames, known, layout, _named(arrays, ("head",)), _named(arrays, ("eyes",))))


def _self_named(path: Path) -> Layout:
    """Curves whose names are the columns of a CSV, or the array `names` of an NPZ; FacesynthError where there are none."""
    names: list[str] = []
    if path.suffix.lower() == ".csv":
        names = [column for column in _columns(path) if column != TIME]
    elif path.suffix.lower() == ".npz":
        names = [str(name) for name in np.ravel(_npz(path, "fiuU").get("names", []))]
    if not names or len(set(names)) != len(names) or any(_is_number(name) or name.endswith(POINTS) for name in names):
        raise FacesynthError(f"{path} does not name its channels; give a layout file, or write {CHANNELS} beside it")
    return Layout("curves", tuple(names))


def _columns(path: Path) -> list[str]:
    try:
        with open(path, encoding="utf-8-sig", newline="") as file:
            return [cell.strip() for cell in next(csv.reader(file), [])]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FacesynthError(f"{path} cannot be read as CSV in UTF-8 ({error}); export it again") from None


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays of an NPZ file that may be damaged; never unpickles."""
    require_file(path)
    return _npz(path)


def _npz(path: Path, kinds: str = "fiu") -> dict[str, NDArray[Any]]:
    require_modest(path)
    try:
        with open(path, "rb") as file, np.load(file, allow_pickle=False) as stored:
            if not hasattr(stored, "files"):
                raise FacesynthError(f"{path} holds one array without a name; save it with numpy.savez(file, frames=…, fps=…)")
            return {name: stored[name] for name in stored.files if stored[name].dtype.kind in kinds}
    except FacesynthError:
        raise
    except (OSError, ValueError, EOFError, KeyError, TypeError, AttributeError, MemoryError, zipfile.BadZipFile) as error:
        raise FacesynthError(f"{path} is no NPZ, or is damaged ({error}); write it again with numpy.savez") from None
    except Exception as error:  # zlib.error and what else a damaged archive raises
        raise FacesynthError(f"{path} is damaged ({error}); write it again") from None


def _mat(path: Path) -> dict[str, NDArray[Any]]:
    found = load_mat(path)
    return {name: value for name, value in found.items() if isinstance(value, np.ndarray) and value.dtype.kind in "fiu"}


def load_mat(path: Path) -> dict[str, Any]:
    """The variables of a MATLAB file (up to version 7.2), structs as objects."""
    from scipy.io import loadmat

    try:
        return {name: value for name, value in loadmat(path, squeeze_me=False).items() if not name.startswith("__")}
    except NotImplementedError:
        raise FacesynthError(f"{path} is a MATLAB 7.3 file; save it with -v7") from None
    except Exception as error:  # SciPy's reader raises anything on damaged files
        raise FacesynthError(f"{path} is no MATLAB file, or is damaged ({error})") from None


def _named(arrays: dict[str, NDArray[Any]], names: tuple[str, ...]) -> NDArray[Any] | None:
    lower = {name.lower(): value for name, value in arrays.items()}
    return next((lower[name] for name in names if name in lower), None)
