"""C3D, the file of optical motion capture: markers with names, gaps and a unit, and sound where an analog channel has it."""

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus.importers.c3d_samples import BLOCK, form_of, length_of, read_samples
from facesynth.corpus.importers.description import UNITS_MM, Written, unit_mm
from facesynth.corpus.importers.reading import Reading, Sound, motion_of_arrays, open_gaps, require_file
from facesynth.corpus.motion_files import shortened
from facesynth.inference.errors import FacesynthError, unknown
from facesynth.inference.layout import Layout

SOUNDS = ("audio", "sound", "mic", "voice", "speech")
"""What analog channels that hold sound are called."""
LOWEST_SOUND_HZ = 4000
MODEL_OUTPUTS = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS", "REACTIONS")
"""Parameters that list points which are none."""
POINT_LISTS = frozenset({"LABELS", "MARKERS", "MODELED_MARKERS", "MODELLED_MARKERS"})
"""Parameters that list points which are places."""
NO_UNIT = frozenset({"", "none", "n/a", "na", "null", "unknown", "undefined", "unit", "units"})
FACE_MM = (25.0, 1000.0)
"""Diagonal that the markers of a face have, from a mouth alone to head and shoulders."""
USUAL_FACE_MM = 250.0
FEWEST_FOR_SIZE = 4
"""Markers that show how large a face is."""


def read_c3d(path: Path, layout: Layout | None = None, written: Written | None = None) -> Reading:
    """Markers in mm; gaps are NaN. A layout picks its markers by name, else all that have a name are taken.

    written: unit, where the file states none or a wrong one, and which of its axes run to the performer's left, up, and
    out of the face.
    """
    require_file(path)
    content = _opened(path)
    are_outputs = _of_model(content.labels, content.outputs)
    labels = _without_subject(content.labels, are_outputs)
    written = written or Written()
    unit = content.unit
    if not written.unit and unit_mm(unit) is None:
        raise FacesynthError(
            f"{path} is in {content.unit!r}; known units are {', '.join(UNITS_MM)}; say the right one in a layout file:"
            " `files: {unit: …}`"
        )
    content.points[:, ~are_outputs], gaps = open_gaps(content.points[:, ~are_outputs])
    placed = written.placed(content.points, unit)
    names = _named(path, labels, are_outputs) if layout is None else layout.names
    for name in names:
        if name not in labels:
            raise FacesynthError(f"{path}: {unknown('marker', name, labels)}")
    place_of = {labels[k]: k for k in sorted(range(len(labels)), key=lambda k: (are_outputs[k], k), reverse=True)}
    places = [place_of[name] for name in names]
    frames = placed[:, places]
    remarks = [*content.remarks, *_left_out(labels, places, are_outputs)]
    remarks += gaps
    remarks += _size(frames, written.unit or unit)
    motion = motion_of_arrays(path, frames.reshape(len(placed), -1), content.fps, layout or Layout("markers", names))
    return Reading(motion, _sound(content), remarks=tuple(remarks))


def _left_out(labels: list[str], places: list[int], are_outputs: NDArray[np.bool_]) -> list[str]:
    """What is said of points that are not taken."""
    computed = [label for k, label in enumerate(labels) if are_outputs[k] and k not in places]
    others = len(labels) - len(places) - len(computed)
    remarks = [f"{others} markers without a name in the layout were left out"] if others else []
    if computed:
        remarks.append(f"{len(computed)} outputs of a model ({shortened(computed, 3)}) are no markers: they were left out")
    return remarks


def _size(frames: NDArray[np.float64], unit: str) -> list[str]:
    """What is said where the unit contradicts the size of a face: frames [T, K, 3] mm."""
    shape = np.nanmedian(frames[:, np.isfinite(frames).all(axis=2).any(axis=0)], axis=0)
    extent = float(np.linalg.norm(np.ptp(shape, axis=0))) if len(shape) >= FEWEST_FOR_SIZE else 0.0
    if not extent or FACE_MM[0] <= extent <= FACE_MM[1]:
        return []
    usual = {name: abs(np.log(extent / (unit_mm(unit) or 1.0) * scale / USUAL_FACE_MM)) for name, scale in UNITS_MM.items()}
    return [
        f"the file states {unit}, which makes the face {extent:.3g} mm large: it looks like {min(usual, key=lambda u: usual[u])};"
        " if so, say `files: {unit: …}` in a layout file"
    ]


def _of_model(labels: list[str], listed: frozenset[str]) -> NDArray[np.bool_]:
    """Which points are outputs: listed under their own name, in any case, else with a subject that one of both states."""
    lists, names = {name.lower() for name in listed}, [label.lower() for label in labels]
    unmatched = lists - set(names)
    bare = {name for name in unmatched if ":" not in name}
    of_subjects = {name.rpartition(":")[2] for name in unmatched if ":" in name}
    return np.array(
        [name in lists or (name.rpartition(":")[2] in bare if ":" in name else name in of_subjects) for name in names], bool
    )


def _without_subject(labels: list[str], are_outputs: NDArray[np.bool_]) -> list[str]:
    """Names without the subject's (`Ada:chin`), where all markers that a person named have the same."""
    subjects = {
        label.rpartition(":")[0]
        for label, is_output in zip(labels, are_outputs, strict=True)
        if label and not label.startswith("*") and not is_output
    }
    if len(subjects) != 1:
        return labels
    prefix = f"{subjects.pop()}:"
    return [label.removeprefix(prefix) for label in labels]


@dataclass(frozen=True, eq=False)
class _Content:
    """A file's markers and analog channels as they stand in it."""

    points: NDArray[np.float64]
    """[T, K, 3] in the file's unit; NaN for gaps."""
    labels: list[str]
    fps: float
    unit: str
    analog: NDArray[np.float32]
    """[channels, S]"""
    analog_labels: list[str]
    analog_rate: float
    outputs: frozenset[str]
    """Labels of what a model computed: angles, forces and the like stand among the points of some programs."""
    remarks: tuple[str, ...]
    """What was noticed."""


def _opened(path: Path) -> _Content:
    try:
        from c3d import Reader  # type: ignore[import-untyped]
    except ImportError:
        raise FacesynthError("reading C3D needs the package c3d; install `facesynth[mocap]`") from None
    try:
        with warnings.catch_warnings(), open(path, "rb") as file:
            warnings.simplefilter("ignore")
            tolerant = type("ReaderOfAnyHeader", (Reader,), {"_check_metadata": lambda _: None})
            content = _content(tolerant(file), file, path.stat().st_size)
    except FacesynthError as error:
        raise FacesynthError(f"{path} {error}") from None
    except Exception as error:  # the library raises anything, bare Exception too, on damaged files
        raise FacesynthError(f"{path} is no C3D file, or is damaged ({' '.join(str(error).split())})") from None
    if not content.points.size:
        raise FacesynthError(f"{path} holds no frames of markers; export it again")
    return content


def _content(reader: Any, file: BinaryIO, size: int) -> _Content:
    for name in ("OFFSET", "SCALE"):  # with a single analog channel many programs write a number, the library wants an array
        parameter = reader.get(f"ANALOG:{name}")
        if parameter is not None and not parameter.dimensions:
            parameter.dimensions = [1]
    form, said = form_of(reader)
    length, remarks = length_of(reader, form, size)
    frames, analog = read_samples(file, form, length)
    if remarks:  # files are padded to whole blocks
        padded = BLOCK // (16 * form.points) + 1 if form.points else 0
        empty = next((k for k in range(padded) if np.nan_to_num(frames[len(frames) - 1 - k]).any()), padded)
        frames, analog = frames[: len(frames) - empty], analog[:, : analog.shape[1] - empty * form.analog_per_frame]
    unit, unsaid = _unit(reader)
    return _Content(
        frames,
        _labels(reader, form.points),
        form.fps,
        unit,
        analog,
        [str(label).strip() for label in reader.analog_labels] if form.analog_channels else [],
        form.fps * form.analog_per_frame,
        frozenset(label for kind in _output_lists(reader) for label in _strings(reader, kind)),
        (*said, *unsaid, *remarks),
    )


def _unit(reader: Any) -> tuple[str, tuple[str, ...]]:
    """The unit of the points, and what is said where the file states none."""
    stated = next(iter(_strings(reader, "UNITS")), "")
    said = stated.strip(" -?.").lower()
    return ("mm", ("the file states no unit; the points were taken as mm",)) if said in NO_UNIT else (stated, ())


def _output_lists(reader: Any) -> list[str]:
    """Names of the parameters that list what a model computed; programs may add to the usual ones, and say so."""
    added = [name.upper() for name in _strings(reader, "TYPE_GROUPS") if name.upper() not in POINT_LISTS]
    return [*MODEL_OUTPUTS, *(name for name in dict.fromkeys(added) if name not in MODEL_OUTPUTS)]


def _labels(reader: Any, count: int) -> list[str]:
    """Names of the points."""
    labels = _strings(reader, "LABELS")
    return [*labels[:count], *(f"*{number}" for number in range(len(labels), count))]


def _strings(reader: Any, name: str) -> list[str]:
    """A list of names in the group of points; beyond 255 it goes on in LABELS2 and so on."""
    parts = (reader.get(f"POINT:{name}{number}") for number in ("", *range(2, 10)))
    arrays = (np.ravel(part.string_array) for part in parts if part is not None and part.dimensions)
    return [str(label).strip(" \0\t") for labels in arrays for label in labels]


def _named(path: Path, labels: list[str], are_outputs: NDArray[np.bool_]) -> tuple[str, ...]:
    """Every marker that a person named."""
    markers = [label for label, is_output in zip(labels, are_outputs, strict=True) if not is_output]
    named = [name for name in markers if name and not name.startswith("*")]
    if not named:
        raise FacesynthError(f"{path} names none of its {len(markers)} markers; name them in the program that recorded them")
    if len(set(named)) != len(named):
        raise FacesynthError(f"{path} names {len(set(named))} different markers of {len(named)}; name each of them once")
    return tuple(named)


def _sound(content: _Content) -> Sound | None:
    rate = content.analog_rate
    for name, channel in zip(content.analog_labels, content.analog, strict=False):
        if rate >= LOWEST_SOUND_HZ and any(word in name.lower() for word in SOUNDS) and np.isfinite(channel).all():
            loudest = float(np.abs(channel - channel.mean()).max(initial=0.0))
            return Sound(((channel - channel.mean()) / max(loudest, 1.0)).astype(np.float32), round(rate))
    return None
