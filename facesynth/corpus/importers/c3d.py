"""C3D, the file of optical motion capture: markers with names, gaps and a unit, and sound where an analog channel has it."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus.importers.description import UNITS_MM, Written
from facesynth.corpus.importers.reading import Reading, Sound, motion_of_arrays, require_file
from facesynth.inference.errors import FacesynthError, unknown
from facesynth.inference.layout import Layout

SOUNDS = ("audio", "sound", "mic", "voice", "speech")
"""What analog channels that hold sound are called."""
LOWEST_SOUND_HZ = 4000


def read_c3d(path: Path, layout: Layout | None = None, written: Written | None = None) -> Reading:
    """Markers in mm; gaps are NaN. A layout picks its markers by name, else all that have a name are taken.

    written: unit, where the file states none or a wrong one, and which of its axes run to the performer's left, up, and
    out of the face.
    """
    require_file(path)
    content = _opened(path)
    labels = _without_subject(content.labels)
    written = written or Written()
    unit = content.unit.lower() or "mm"
    if not written.unit and unit not in UNITS_MM:
        raise FacesynthError(
            f"{path} is in {content.unit!r}; known units are {', '.join(UNITS_MM)}; say the right one in a layout file:"
            " `files: {unit: …}`"
        )
    placed = written.placed(content.points, unit)
    names = _named(path, labels) if layout is None else layout.names
    for name in names:
        if name not in labels:
            raise FacesynthError(f"{path}: {unknown('marker', name, labels)}")
    frames = placed[:, [labels.index(name) for name in names]].reshape(len(placed), -1)
    others = len(labels) - len(names)
    remarks = (f"{others} markers without a name in the layout were left out",) if others else ()
    motion = motion_of_arrays(path, frames, content.fps, layout or Layout("markers", names))
    return Reading(motion, _sound(content), remarks=remarks)


def _without_subject(labels: list[str]) -> list[str]:
    """Names without the subject's (`Ada:chin`), where all that a person gave have the same."""
    subjects = {label.rpartition(":")[0] for label in labels if label and not label.startswith("*")}
    return [label.rpartition(":")[2] for label in labels] if len(subjects) == 1 else labels


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
    except Exception as error:  # the library raises anything, bare Exception too, on damaged files
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
        unseen = (points[:, 3:4] < 0) | ~points[:, :3].any(axis=1, keepdims=True)  # some programs write 0, 0, 0 for a gap
        frames.append(np.where(unseen, np.nan, points[:, :3].astype(np.float64)))
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


def _named(path: Path, labels: list[str]) -> tuple[str, ...]:
    """Every marker that a person named."""
    named = [name for name in labels if name and not name.startswith("*")]
    if not named or len(set(named)) != len(named):
        raise FacesynthError(f"{path} names {len(set(named))} different markers of {len(named)}; name each of them once")
    return tuple(named)


def _sound(content: _Content) -> Sound | None:
    rate = content.analog_rate
    for name, channel in zip(content.analog_labels, content.analog, strict=False):
        if rate >= LOWEST_SOUND_HZ and any(word in name.lower() for word in SOUNDS) and np.isfinite(channel).all():
            loudest = float(np.abs(channel - channel.mean()).max(initial=0.0))
            return Sound(((channel - channel.mean()) / max(loudest, 1.0)).astype(np.float32), round(rate))
    return None
