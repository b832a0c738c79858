"""Weights of a face as BEAT keeps them: JSON with names, and frames that hold weights and a time each; Audio2Face's as well."""

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from facesynth.corpus.importers.reading import Reading, motion_of_arrays, require_file
from facesynth.corpus.importers.timed import at_steady_rate
from facesynth.corpus.motion_files import shortened
from facesynth.encoding import decoded
from facesynth.inference.arrays import Floats
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.motion.arkit_names import ARKIT_NAMES
from facesynth.motion.livelink import ANGLES, FEWEST_SHAPES, as_shares

HEAD_BYTES = 1 << 16
SLOWEST_FPS = 5.0
UNITS_S = {"seconds": 1.0, "milliseconds": 1e-3, "microseconds": 1e-6, "nanoseconds": 1e-9}
"""Units of times, of which the first is taken by which frames come `SLOWEST_FPS` times a second or more."""
_SPELLED = {name.lower(): name for name in ARKIT_NAMES}
_ANGLES = frozenset(name.lower() for name in ANGLES)


def is_beat(path: Path) -> bool:
    """Whether a JSON file holds frames of weights."""
    with open(path, "rb") as file:
        head = file.read(HEAD_BYTES).replace(b"\0", b"")
    return (b'"frames"' in head and b'"weights"' in head) or b'"weightMat"' in head


def read_beat(path: Path, fps: float | None = None) -> Reading:
    """Curves by name; of ARKit's 52 shapes those that the file lacks are 0. fps: its rate, if frames have no times."""
    require_file(path)
    names, weights, times, stated = _content(path)
    times_s, told = _in_seconds(path, times, fps or stated, len(weights))
    are_weights = [name.lower() not in _ANGLES for name in names]
    if not all(are_weights):
        gone = [name for name, weight in zip(names, are_weights, strict=True) if not weight]
        names, weights = tuple(name for name in names if name not in gone), weights[:, are_weights]
        told = [*told, f"angles of head and eyes are not read from it: {shortened(gone)}"]
    known = np.nan_to_num(weights)
    shares, said = as_shares(path, known, [True] * len(names))
    gaps = np.isnan(weights)
    if gaps.any():
        said = [*said, f"{np.count_nonzero(gaps)} weights are missing: they are gaps"]
    weights = np.where(gaps, np.nan, np.clip(shares, 0, 1))
    lacking = [name for name in ARKIT_NAMES if name not in names]
    if len(ARKIT_NAMES) - len(lacking) < FEWEST_SHAPES:
        lacking = []
    if lacking:
        said = [*said, f"{len(lacking)} of ARKit's {len(ARKIT_NAMES)} shapes are not in it and stay 0: {shortened(lacking)}"]
    whole = np.concatenate([weights, np.zeros((len(weights), len(lacking)))], axis=1)
    frames, rate, remarks = at_steady_rate(path, whole, times_s)
    motion = motion_of_arrays(path, frames, rate, Layout("curves", (*names, *lacking)))
    return Reading(motion, remarks=(*said, *told, *remarks))


def _in_seconds(path: Path, times: Floats | None, fps: float | None, count: int) -> tuple[Floats, list[str]]:
    """[T] seconds of each frame, by their times in whatever unit, or by the rate that is stated, and what was assumed."""
    steps = np.diff(times) if times is not None else np.empty(0)
    numbers = times is None or (len(steps) > 0 and bool((steps == 1).all()))
    if numbers and fps:
        return np.arange(count) / fps, [f"its frames are numbered: they stand at the stated {fps:g} fps"]
    if times is None or numbers:
        raise FacesynthError(f"{path} numbers its frames and gives them no times; give the rate (--fps)")
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    unit = next((name for name, length_s in UNITS_S.items() if step * length_s <= 1 / SLOWEST_FPS), "seconds")
    return times * UNITS_S[unit], [] if unit == "seconds" else [f"its times are taken as {unit}"]


def _content(path: Path) -> tuple[tuple[str, ...], Floats, Floats | None, float | None]:
    """Names, weights [T, C] with NaN where there is none, times [T] in the file's unit, and the rate that it states."""
    try:
        plain = json.loads(decoded(path.read_bytes())[0])
        frames = plain["frames"] if "weightMat" not in plain else [{"weights": row} for row in plain["weightMat"]]
        listed = plain.get("names") or plain.get("blendshapes") or plain.get("facsNames") or list(frames[0]["weights"])
        about = plain.get("metadata") if isinstance(plain.get("metadata"), Mapping) else {}
        given = next((place[key] for place in (plain, about) for key in ("fps", "exportFps") if place.get(key)), None)
        stated = float(given) if given is not None else None
        rows = [_row(path, number, frame["weights"], listed) for number, frame in enumerate(frames, start=1)]
        times = [frame.get("time", frame.get("timestamp")) for frame in frames]
        weights = np.array(rows, np.float64)
        times_of = None if any(time is None for time in times) else np.array(times, np.float64)
    except FacesynthError:
        raise
    except (ValueError, TypeError, KeyError, AttributeError, IndexError, RecursionError) as error:
        reason = f"it lacks {error}" if isinstance(error, KeyError) else " ".join(str(error).split())[:160]
        raise FacesynthError(f"{path} holds no frames of weights as BEAT keeps them ({reason})") from None
    names = tuple(_spelled(str(name)) for name in listed)
    if weights.ndim != 2 or weights.shape[1] != len(names) or len(set(names)) != len(names):
        twice = next((name for name in names if names.count(name) > 1), None)
        why = f"{twice!r} is there twice" if twice else f"its frames hold weights of shape {list(weights.shape)}"
        raise FacesynthError(f"{path} names {len(names)} shapes, but {why}")
    if np.isinf(weights).any() or np.isnan(weights).all() or (times_of is not None and not np.isfinite(times_of).all()):
        raise FacesynthError(f"{path} holds infinite values or none at all; export it again")
    return names, weights, times_of, stated


def _row(path: Path, number: int, weights: Any, names: list[str]) -> list[float]:
    """The weights of a frame in the order of the names; None is none."""
    if isinstance(weights, Mapping):
        weights = [weights.get(name) for name in names]
    if len(weights) != len(names):
        raise FacesynthError(f"{path}: frame {number} holds {len(weights)} weights, {len(names)} shapes are named")
    return [np.nan if weight is None else float(weight) for weight in weights]


def _spelled(name: str) -> str:
    """ARKit's name in its own spelling, whatever its case, sides and prefix."""
    plain = re.sub("[_ ]", "", re.sub(r"_([lr])$", lambda side: {"l": "Left", "r": "Right"}[side[1]], _bare(name).lower()))
    return _SPELLED.get(plain.lower(), name)


def _bare(name: str) -> str:
    return re.split(r"[.:|]", name)[-1]
