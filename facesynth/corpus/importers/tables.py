"""CSV, NPZ and MAT of any points or curves, with a layout that names them; and weights with a list of their names."""

import re
from collections.abc import Mapping
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus.importers.description import ORDER, Written
from facesynth.corpus.importers.matlab import load_mat
from facesynth.corpus.importers.reading import Reading, motion_of_arrays, require_file
from facesynth.corpus.motion_files import number_column, read_csv, shortened, time_column
from facesynth.inference.errors import FacesynthError, unknown
from facesynth.inference.layout import Kind, Layout
from facesynth.inference.long_arrays import by_blocks
from facesynth.inference.npz import read_all_arrays
from facesynth.motion.cells import is_number, read_names

CHANNELS = "channels.txt"
"""Beside weights: the names of the columns, one a line."""
FRAMES = ("frames", "weights", "points", "positions", "position", "pos", "markers", "trajectories", "xyz", "data", "signal")
RATES = ("fps", "rate", "srate", "framerate", "samplerate", "samplingrate", "fs", "sr", "hz", "freq", "frequency")
"""Usual names of variables, in lower case and without anything but letters."""
_OF_A_POINT = re.compile(r"(.+)[ ._:-]([xyzXYZ])")
DEEPEST = 3
"""Structs within structs."""


def read_channels(path: Path) -> Layout:
    """Curves named in a text file, one a line."""
    try:
        names = [line.strip() for line in path.read_text(encoding="utf-8-sig").splitlines() if line.strip()]
    except (OSError, UnicodeDecodeError) as error:
        raise FacesynthError(f"{path} cannot be read as a list of names in UTF-8 ({error})") from None
    return Layout("curves", tuple(names))


def read_table(
    path: Path, layout: Layout | None, fps: float | None, written: Written | None = None, *, otherwise: Layout | None = None
) -> Reading:
    """Motion [T, C] or [T, K, dimension] under any usual name in a CSV, NPZ or MAT, or under the one that `written` says.

    The layout is the given one, else that of `channels.txt` in the same folder, else what the file names itself, else
    `otherwise`; the rate is the file's own, else the one that `written` says, else `fps`.
    """
    require_file(path)
    written = written or Written()
    beside = path.with_name(CHANNELS)
    if layout is None and beside.is_file():
        layout = read_channels(beside)
    if is_number(written.rate):
        fps = float(written.rate)
    if path.suffix.lower() == ".csv":
        layout = layout or otherwise or _named_columns(path, written)
        motion, remarks = read_csv(path, layout, fps or 1.0, written, only_own_rate=fps is None)
        motion_of_arrays(path, motion.frames, motion.fps, layout)
        return Reading(motion, remarks=remarks)
    arrays = read_numbers(path) if path.suffix.lower() == ".npz" else _mat(path)
    array, frames = _motion_array(path, arrays, written)
    layout = layout or _named_array(path, frames, otherwise)
    frames, remarks = _in_order(path, frames, layout, written)
    if layout.dimension > 1 and frames.shape[1:] == (layout.channels,):
        frames = by_blocks(lambda some: written.placed(layout.points(some)).reshape(len(some), -1), frames)
    head, eyes = (_named(arrays, (name,)) if array.lower() != name else None for name in ("head", "eyes"))
    motion = motion_of_arrays(path, frames, _rate(path, arrays, written, fps), layout, head, eyes)
    return Reading(motion, remarks=remarks)


def _motion_array(path: Path, arrays: Mapping[str, NDArray[Any]], written: Written) -> tuple[str, NDArray[Any]]:
    """Name and values of the array that holds the motion."""
    if written.array:
        if written.array not in arrays:
            raise FacesynthError(f"{path}: {unknown('array', written.array, arrays)}")
        return written.array, arrays[written.array]
    usual = {_letters(name): name for name in reversed(list(arrays))}
    found = next((usual[name] for name in FRAMES if name in usual), None)
    large = [name for name, value in arrays.items() if value.ndim in (2, 3) and value.size > 3 and min(value.shape) > 1]
    found = found or (large[0] if len(large) == 1 else None)
    if found is None:
        raise FacesynthError(
            f"{path} holds {shortened(list(arrays)) or 'nothing'}, but none of {', '.join(FRAMES)}; name the array in the layout"
            " file: `files: {array: NAME}`"
        )
    return found, arrays[found]


def _rate(path: Path, arrays: Mapping[str, NDArray[Any]], written: Written, fps: float | None) -> float:
    if written.rate and not is_number(written.rate):
        if written.rate not in arrays or arrays[written.rate].size != 1:
            raise FacesynthError(f"{path}: {unknown('number for the rate', written.rate, arrays)}")
        return float(arrays[written.rate].ravel()[0])
    usual = {_letters(name): value for name, value in arrays.items() if value.size == 1}
    stated = next((float(usual[name].ravel()[0]) for name in RATES if name in usual), None)
    known = stated if stated is not None else fps
    if known is None:
        raise FacesynthError(
            f"{path} holds {shortened(list(arrays))}, but no rate (fps); give it (--fps), or name it in the layout file:"
            " `files: {rate: NAME}`"
        )
    return known


def _in_order(path: Path, frames: NDArray[Any], layout: Layout, written: Written) -> tuple[NDArray[Any], tuple[str, ...]]:
    """An array of any order of dimensions as [T, C], and what was done to it; what fits in no way stays, to be refused."""
    count, dimension = len(layout.names), layout.dimension
    if written.dimensions:
        if len(written.dimensions) != frames.ndim:
            raise FacesynthError(f"{path}: order names {len(written.dimensions)} dimensions, the array has {frames.ndim}")
        places = [written.dimensions.index(name) for name in ORDER if name in written.dimensions]
        ordered = frames.transpose(places)
        return _picked(path, ordered, written), ()
    if written.columns:
        return _picked(path, frames, written), ()
    if frames.ndim == 3:
        fitting = [turn for turn in permutations(range(3)) if frames.transpose(turn).shape[1:] == (count, dimension)]
        if (0, 1, 2) not in fitting and len(fitting) == 1:
            names = ", ".join(ORDER[fitting[0].index(place)] for place in range(3))
            return frames.transpose(fitting[0]).reshape(-1, count * dimension), (f"the array's dimensions were taken as {names}",)
        if (0, 1, 2) in fitting:
            return frames.reshape(len(frames), -1), ()
    if frames.ndim == 2 and frames.shape[0] == layout.channels != frames.shape[1]:
        return frames.T, ("the array's dimensions were taken as channels, time",)
    return frames, ()


def _picked(path: Path, frames: NDArray[Any], written: Written) -> NDArray[Any]:
    """[T, …] as [T, C], with those of each frame's values that are used."""
    flat = frames.reshape(len(frames), -1)
    try:
        return flat[:, written.picked_from(flat.shape[1])]
    except FacesynthError as error:
        raise FacesynthError(f"{path}: {error}") from None


def _named_columns(path: Path, written: Written) -> Layout:
    """Curves, or points whose columns end in .x, .y and .z, as the first line of a CSV names them."""
    names = read_names(path, written.separator, written.decimal)
    time = time_column(names, written)
    return _layout_of(path, [name for name in names if name not in (time, number_column(names))])


def _named_array(path: Path, frames: NDArray[Any], otherwise: Layout | None) -> Layout:
    """What the array `names` of an NPZ names: points where the motion is [T, K, 3] or [T, K, 2], else curves."""
    names = [str(name) for name in np.ravel(_npz(path).get("names", []))] if path.suffix.lower() == ".npz" else []
    if otherwise is not None and not names:
        return otherwise
    if frames.ndim == 3 and names and len(set(names)) == len(names) == frames.shape[1] and frames.shape[2] in (2, 3):
        return Layout("markers" if frames.shape[2] == 3 else "landmarks", tuple(names))
    return _layout_of(path, names)


def _layout_of(path: Path, names: list[str]) -> Layout:
    """Points where columns end in their axes (`chin.x`, `Chin Y`, …), else curves."""
    axes: dict[str, str] = {}
    for name in names:
        if (found := _OF_A_POINT.fullmatch(name)) is not None:
            axes[found[1]] = axes.get(found[1], "") + found[2].lower()
    kinds: tuple[tuple[Kind, str], ...] = (("markers", "xyz"), ("landmarks", "xy"))
    for kind, wanted in kinds:
        whole = all("".join(sorted(own)) == wanted for own in axes.values())
        if axes and whole and 2 * len(axes) * len(wanted) >= len(names):
            return Layout(kind, tuple(axes))
    dotted = any(name[-2:].lower() in (".x", ".y", ".z") for name in names)
    if not names or dotted or len(set(names)) != len(names) or any(map(is_number, names)):
        raise FacesynthError(f"{path} does not name its channels; give a layout file, or write {CHANNELS} beside it")
    return Layout("curves", tuple(names))


def _letters(name: str) -> str:
    return "".join(letter for letter in name.rpartition(".")[2].lower() if letter.isalpha())


def read_numbers(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays of numbers of an NPZ file."""
    return {name: array for name, array in _npz(path).items() if array.dtype.kind in "fiu"}


def _npz(path: Path) -> dict[str, NDArray[Any]]:
    require_file(path)
    return read_all_arrays(path, "an NPZ file of numpy.savez")


def _mat(path: Path) -> dict[str, NDArray[Any]]:
    return _numbers(load_mat(path))


def _numbers(found: Mapping[str, Any], prefix: str = "") -> dict[str, NDArray[Any]]:
    """Arrays of numbers, those in single structs under `struct.field`."""
    arrays: dict[str, NDArray[Any]] = {}
    for name, value in found.items():
        if isinstance(value, np.ndarray) and value.dtype.kind in "fiu":
            arrays[prefix + name] = value
        elif isinstance(value, np.ndarray) and value.dtype.names and value.size == 1 and prefix.count(".") < DEEPEST:
            fields = {field: value.ravel()[0][field] for field in value.dtype.names}
            arrays |= _numbers(fields, f"{prefix}{name}.")
    return arrays


def _named(arrays: dict[str, NDArray[Any]], names: tuple[str, ...]) -> NDArray[Any] | None:
    lower = {name.lower(): value for name, value in arrays.items()}
    return next((lower[name] for name in names if name in lower), None)
