"""C3D, the file of optical motion capture: markers with names, gaps and a unit, and sound where an analog channel has it."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus.importers.reading import Reading, Sound, motion_of_arrays, require_file
from facesynth.errors import FacesynthError, unknown
from facesynth.motion.layout import Layout

UNITS_MM = {"mm": 1.0, "cm": 10.0, "dm": 100.0, "m": 1000.0, "um": 1e-3, "in": 25.4, "inch": 25.4, "ft": 304.8}
SOUNDS = ("audio", "sound", "mic", "voice", "speech")
"""What analog channels that hold sound are called."""
LOWEST_SOUND_HZ = 4000
AXES = "xyz"


def read_c3d(path: Path, layout: Layout | None = None, axes: str = "x,y,z") -> Reading:
    """Markers in mm; gaps are NaN. A layout picks its markers by name, else all that have a name are taken.

    axes: which of the file's axes run to the performer's left, up, and out of the face, such as `x,z,-y`.
    """
    require_file(path)
    content = _opened(path)
    labels = content.labels
    unit = content.unit.lower() or "mm"
    if unit not in UNITS_MM:
        raise FacesynthError(f"{path} is in {content.unit!r}; known units are {', '.join(UNITS_MM)}")
    placed = turned(content.points * UNITS_MM[unit], axes)
    chosen = layout or _layout(path, labels, placed)
    for name in chosen.names:
        if name not in labels:
            raise FacesynthError(f"{path}: {unknown('marker', name, labels)}")
    frames = placed[:, [labels.index(name) for name in chosen.names]].reshape(len(placed), -1)
    others = len(labels) - len(chosen.names)
    remarks = (f"{others} markers without a name in the layout were left out",) if others else ()
    return Reading(motion_of_arrays(path, frames, content.fps, chosen), _sound(content), remarks=remarks)


def turned(points: NDArray[np.float64], axes: str) -> NDArray[np.float64]:
    """Points [T, K, 3] with other axes, said as three signed letters."""
    parts = [part.strip().lower() for part in axes.split(",")]
    letters = [part.lstrip("+-") for part in parts]
    if sorted(letters) != list(AXES):
        raise FacesynthError(f"axes are three different signed letters such as x,z,-y; got {axes!r}")
    signs = [-1.0 if part.startswith("-") else 1.0 for part in parts]
    return points[..., [AXES.index(letter) for letter in letters]] * signs


@dataclass(frozen=True, eq=False)
class _Content:
    """A file's markers and analog channels as they stand in it."""

    points: NDArray[np.float64]
    """[T, K, 3] in the file's unit; NaN for gaps."""
    labels: list[str]
    fps: float
    unit: str
    analog: NDArray[np.float64]
    """[channels, S]"""
    analog_labels: list[str]
    analog_rate: float


def _opened(path: Path) -> _Content:
    try:
        from c3d import Reader  # type: ignore[import-untyped]
    except ImportError:
        raise FacesynthError("reading C3D needs the package c3d; install `facesynth[mocap]`") from None
    try:
        with warnings.catch_warnings(record=True) as said, open(path, "rb") as file:
            warnings.simplefilter("always")
            content = _content(Reader(file))
    except Exception as error:  # the library raises anything on damaged files
        raise FacesynthError(f"{path} is no C3D file, or is damaged ({' '.join(str(error).split())})") from None
    if any("end of file" in str(warning.message) for warning in said):
        raise FacesynthError(f"{path} is cut off: it states more frames than it holds; copy it again")
    if not content.points.size:
        raise FacesynthError(f"{path} holds no frames of markers; export it again")
    return content


def _content(reader: Any) -> _Content:
    for name in ("OFFSET", "SCALE"):  # with a single analog channel many programs write a number, the library wants an array
        parameter = reader.get(f"ANALOG:{name}")
        if parameter is not None and not parameter.dimensions:
            parameter.dimensions = [1]
    count = int(reader.point_used)
    frames, analog = [], []
    for _, points, channels in reader.read_frames():
        frames.append(np.where(points[:, 3:4] < 0, np.nan, points[:, :3]))
        analog.append(channels)
    unit = reader.get("POINT:UNITS")
    return _Content(
        np.array(frames, np.float64).reshape(len(frames), count, 3),
        _labels(reader, count),
        float(reader.point_rate),
        str(unit.string_value).strip() if unit is not None else "mm",
        np.concatenate(analog, axis=1) if analog and reader.analog_used else np.zeros((0, 0)),
        [str(label).strip() for label in reader.analog_labels] if reader.analog_used else [],
        float(reader.analog_rate),
    )


def _labels(reader: Any, count: int) -> list[str]:
    """Names of the markers; beyond 255 they go on in LABELS2 and so on."""
    labels: list[str] = []
    for name in ("LABELS", *(f"LABELS{number}" for number in range(2, 10))):
        found = reader.get(f"POINT:{name}")
        labels += [str(label).strip() for label in found.string_array] if found is not None else []
    return [*labels[:count], *(f"*{number}" for number in range(len(labels), count))]


def _layout(path: Path, labels: list[str], points: NDArray[np.float64]) -> Layout:
    """Every marker that a person named; the middle of what was seen is taken as its rest."""
    named = [name for name in labels if name and not name.startswith("*")]
    if not named or len(set(named)) != len(named):
        raise FacesynthError(f"{path} names {len(set(named))} different markers of {len(named)}; name each of them once")
    seen = points[:, [labels.index(name) for name in named]]
    if np.isnan(seen).all(axis=(0, 2)).any():
        return Layout("markers", tuple(named))
    return Layout("markers", tuple(named), neutral=tuple(np.nanmedian(seen, axis=0).ravel().tolist()))


def _sound(content: _Content) -> Sound | None:
    rate = content.analog_rate
    for name, channel in zip(content.analog_labels, content.analog, strict=False):
        if rate >= LOWEST_SOUND_HZ and any(word in name.lower() for word in SOUNDS) and np.isfinite(channel).all():
            loudest = float(np.abs(channel - channel.mean()).max(initial=0.0))
            return Sound(((channel - channel.mean()) / max(loudest, 1.0)).astype(np.float32), round(rate))
    return None
