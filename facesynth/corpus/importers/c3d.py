"""C3D, the file of optical motion capture: markers with names, gaps and a unit, and sound where an analog channel has it."""

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus.importers.description import UNITS_MM, Written, unit_mm
from facesynth.corpus.importers.reading import Reading, Sound, motion_of_arrays, open_gaps, require_file
from facesynth.corpus.motion_files import shortened
from facesynth.inference.errors import FacesynthError, unknown
from facesynth.inference.layout import Layout

SOUNDS = ("audio", "sound", "mic", "voice", "speech")
"""What analog channels that hold sound are called."""
LOWEST_SOUND_HZ = 4000
MODEL_OUTPUTS = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS")
"""Parameters that list points which are none."""
BLOCK = 512
"""Bytes that files are padded to."""
FULL = 65535
"""The highest count of 16 bits."""
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
    unit = content.unit or "mm"
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
    """Which points are outputs: listed under their own name, else with a subject that only the list or only the label states."""
    unmatched = listed - set(labels)
    bare = {name for name in unmatched if ":" not in name}
    of_subjects = {name.rpartition(":")[2] for name in unmatched if ":" in name}
    return np.array(
        [label in listed or (label.rpartition(":")[2] in bare if ":" in label else label in of_subjects) for label in labels],
        bool,
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
    analog: NDArray[np.float64]
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
            content = _content(Reader(file), path.stat().st_size)
    except FacesynthError as error:
        raise FacesynthError(f"{path} {error}") from None
    except Exception as error:  # the library raises anything, bare Exception too, on damaged files
        raise FacesynthError(f"{path} is no C3D file, or is damaged ({' '.join(str(error).split())})") from None
    if not content.points.size:
        raise FacesynthError(f"{path} holds no frames of markers; export it again")
    return content


def _content(reader: Any, size: int) -> _Content:
    for name in ("OFFSET", "SCALE"):  # with a single analog channel many programs write a number, the library wants an array
        parameter = reader.get(f"ANALOG:{name}")
        if parameter is not None and not parameter.dimensions:
            parameter.dimensions = [1]
    count = int(reader.point_used)
    length, remarks = _length(reader, size)
    frames, analog = np.full((length, count, 3), np.nan), []
    reader.__class__ = _of_length(type(reader), length)
    for number, (_, points, channels) in enumerate(reader.read_frames()):
        frames[number] = np.where(points[:, 3:4] < 0, np.nan, points[:, :3])
        analog.append(channels.astype(np.float32))
    if remarks:  # files are padded to whole blocks
        padded = BLOCK // (16 * count) + 1 if count else 0
        empty = next((k for k in range(padded) if np.any(frames[len(frames) - 1 - k])), padded)
        frames, analog = frames[: len(frames) - empty], analog[: len(frames) - empty]
    unit = reader.get("POINT:UNITS")
    return _Content(
        frames,
        _labels(reader, count),
        float(reader.point_rate),
        str(unit.string_value).strip() if unit is not None else "mm",
        np.concatenate(analog, axis=1) if analog and reader.analog_used else np.zeros((0, 0)),
        [str(label).strip() for label in reader.analog_labels] if reader.analog_used else [],
        float(reader.analog_rate),
        frozenset(label for kind in MODEL_OUTPUTS for label in _strings(reader, kind)),
        remarks,
    )


# The header counts frames in 16 bits, so recordings of 65,536 frames and more are counted elsewhere, or wrongly. All the counts
# that a file may hold are looked at; the one that the size of the file bears out is taken, else what the size says.
def _length(reader: Any, size: int) -> tuple[int, tuple[str, ...]]:
    """How many frames the file holds, and what was noticed; FacesynthError where it is cut off."""
    word = 4 if reader.point_scale < 0 else 2
    each = word * (4 * int(reader.point_used) + int(reader.analog_used) * int(reader.analog_per_frame))
    room = size - BLOCK * (int(reader.header.data_block) - 1)
    whole = room // each if each else 0
    stated = sorted(_stated_lengths(reader), reverse=True)
    for length in stated:
        if 0 < length <= whole and room - length * each < BLOCK + each:
            return length, ()
    if stated and min(stated) > 0 and max(stated) > whole and not any(length >= FULL for length in stated):
        raise FacesynthError(f"is cut off: it states {max(stated)} frames and holds {whole}; copy it again")
    counts = range(whole, max(whole - BLOCK // max(each, 1) - 2, FULL), -1)
    wrapped = next((count for count in counts for length in stated if length < FULL and (count - length) % (FULL + 1) == 0), None)
    if whole > FULL and (wrapped is not None or FULL in stated):
        count = wrapped or whole
        return count, (f"the header cannot count its {count} frames; the size of the file tells them",)
    fitting = [length for length in stated if 0 < length <= whole]
    if fitting:
        return fitting[0], ()
    return whole, (f"the header states no length that the file bears out; it holds {whole} frames",)


def _stated_lengths(reader: Any) -> set[int]:
    """Every count of frames in the file."""
    lengths = {int(reader.header.last_frame) - int(reader.header.first_frame) + 1}
    ends = [reader.get(f"TRIAL:ACTUAL_{which}_FIELD") for which in ("START", "END")]
    if all(end is not None and len(end.bytes) >= 4 for end in ends):
        first, last = (int(words[0]) + (int(words[1]) << 16) for words in (end.uint16_array for end in ends))
        lengths.add(last - first + 1)
    for name in ("LONG_FRAMES", "FRAMES"):
        parameter = reader.get(f"POINT:{name}")
        if parameter is not None and len(parameter.bytes) >= 2:
            stated = parameter.float_value if len(parameter.bytes) >= 4 else parameter.uint16_value
            lengths |= {int(stated)} if np.isfinite(stated) else set()
    return lengths


def _of_length(kind: type, length: int) -> type:
    """The library's reader, which reads so many frames."""
    return type("ReaderOfLength", (kind,), {"first_frame": 1, "last_frame": length})


def _labels(reader: Any, count: int) -> list[str]:
    """Names of the points."""
    labels = _strings(reader, "LABELS")
    return [*labels[:count], *(f"*{number}" for number in range(len(labels), count))]


def _strings(reader: Any, name: str) -> list[str]:
    """A list of names in the group of points; beyond 255 it goes on in LABELS2 and so on."""
    parts = (reader.get(f"POINT:{name}{number}") for number in ("", *range(2, 10)))
    return [str(label).strip() for part in parts if part is not None and part.dimensions for label in part.string_array]


def _named(path: Path, labels: list[str], are_outputs: NDArray[np.bool_]) -> tuple[str, ...]:
    """Every marker that a person named."""
    markers = [label for label, is_output in zip(labels, are_outputs, strict=True) if not is_output]
    named = [name for name in markers if name and not name.startswith("*")]
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
