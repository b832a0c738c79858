"""Electromagnetic articulography in MVIEW's structs: sensors on tongue, lips and jaw, sound, phones and words in one file."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus.importers.matlab import load_mat
from facesynth.corpus.importers.reading import Reading, Sound, motion_of_arrays, require_file
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.speech.segments import Segment, phone_track

FIELDS = {"NAME", "SRATE", "SIGNAL"}
SILENCES = {"", "sp", "sil", "pau"}
GROUPS = {
    "mouth": ("UL", "LL", "ML"),
    "lips_inner": ("UL", "LL"),
    "upper_lip": ("UL",),
    "lower_lip": ("LL",),
    "jaw": ("JAW", "JAWL", "LI"),
    "tongue": ("TR", "TB", "TT", "TD"),
}
"""Usual names of the sensors."""


def is_articulography(variables: dict[str, Any]) -> bool:
    """Whether a MATLAB file holds MVIEW's structs."""
    return any(_is_struct(value) for value in variables.values())


def read_articulography(path: Path) -> Reading:
    """Sensors in mm (x to the speaker's left, y up, z forward), sound, phones and words.

    MVIEW's positions run forward, to the left, and up. Sensor orientations are left out.
    """
    require_file(path)
    structs = next((value.ravel() for value in load_mat(path).values() if _is_struct(value)), None)
    if structs is None:
        raise FacesynthError(f"{path} holds no structs with NAME, SRATE and SIGNAL, as MVIEW writes them")
    try:
        return _read(path, structs)
    except (IndexError, TypeError, AttributeError, KeyError) as error:  # structs within structs, of any form
        raise FacesynthError(f"{path}: its structs are not as MVIEW writes them ({error})") from None


def _read(path: Path, structs: NDArray[Any]) -> Reading:
    tracks = {_text(struct["NAME"]): struct for struct in structs}
    sounds = [struct for struct in structs if min(np.shape(struct["SIGNAL"])) == 1]
    sensors = {
        name: struct for name, struct in tracks.items() if np.ndim(struct["SIGNAL"]) == 2 and struct["SIGNAL"].shape[1] >= 3
    }
    if not sensors:
        raise FacesynthError(f"{path} holds no sensors with x, y and z")
    rates = {_number(struct["SRATE"]) for struct in sensors.values()}
    lengths = {len(struct["SIGNAL"]) for struct in sensors.values()}
    if len(rates) != 1 or len(lengths) != 1:
        raise FacesynthError(f"{path}: the sensors have different rates or lengths ({sorted(rates)} Hz, {sorted(lengths)})")
    points = np.stack([np.asarray(struct["SIGNAL"][:, :3], np.float64)[:, [1, 2, 0]] for struct in sensors.values()], axis=1)
    motion = motion_of_arrays(path, points.reshape(len(points), -1), rates.pop(), sensor_layout(tuple(sensors)))
    if not sounds:
        return Reading(motion)
    sound = _sound(sounds[0])
    duration_s = len(sound.audio) / sound.sample_rate
    words = tuple(word for word in _segments(sounds[0], "WORDS") if word[0].lower() not in SILENCES)
    phones = _segments(sounds[0], "PHONES")
    track = phone_track(_within(phones, duration_s), duration_s) if phones else None
    return Reading(motion, sound, track, tuple(_within(words, duration_s)), _text(_field(sounds[0], "SENTENCE")))


def sensor_layout(names: tuple[str, ...]) -> Layout:
    """Sensors with the groups that their usual names mean."""
    groups = {group: tuple(names.index(name) for name in members if name in names) for group, members in GROUPS.items()}
    pairs = ((names.index("UL"), names.index("LL")),) if {"UL", "LL"} <= set(names) else ()
    return Layout("markers", names, {group: found for group, found in groups.items() if found}, pairs)


def _is_struct(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.dtype.names is not None and set(value.dtype.names) >= FIELDS


def _sound(struct: Any) -> Sound:
    audio = np.asarray(struct["SIGNAL"], np.float64).ravel()
    loudest = float(np.abs(audio).max(initial=0.0))
    return Sound((audio / max(loudest, 1.0)).astype(np.float32), round(_number(struct["SRATE"])))


def _segments(struct: Any, name: str) -> list[Segment]:
    """Label, start and end (s) of a field of structs with LABEL and OFFS."""
    found = _field(struct, name)
    if not isinstance(found, np.ndarray) or found.dtype.names is None:
        return []
    spans = [(_text(item["LABEL"]), *np.asarray(item["OFFS"], np.float64).ravel()[:2].tolist()) for item in found.ravel()]
    return [(label, start_s, end_s) for label, start_s, end_s in spans if end_s > start_s]


def _within(segments: Iterable[Segment], duration_s: float) -> list[Segment]:
    return [(label, start_s, min(end_s, duration_s)) for label, start_s, end_s in segments if start_s < duration_s]


def _field(struct: Any, name: str) -> Any:
    return struct[name] if name in (struct.dtype.names or ()) else None


def _text(value: Any) -> str:
    flat = np.ravel(value)
    return str(flat[0]).strip() if flat.size else ""


def _number(value: Any) -> float:
    return float(np.ravel(value)[0])
