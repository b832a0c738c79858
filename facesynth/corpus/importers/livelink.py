"""Takes of the Live Link Face app: weights by name, angles of head and eyes, and timecodes."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from facesynth.corpus.importers.reading import Reading, motion_of_arrays, require_file
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout

FIRST = ("Timecode", "BlendshapeCount")
LIVE_LINK = b"Timecode,BlendshapeCount,"
"""How a take of the app begins."""
ANGLES = tuple(f"{what}{angle}" for what in ("Head", "LeftEye", "RightEye") for angle in ("Yaw", "Pitch", "Roll"))
EYE_ANGLES = ANGLES[3:]
"""Kept as curves of their own (`leftEyeYaw`, …; rad): a motion has one gaze, a take two, and their rolls."""
_TIMECODE = re.compile(r"(\d{1,3}):([0-5]\d):([0-5]\d):(\d{2,3})(?:\.(\d+))?")
_RATES = (24.0, 25.0, 30.0, 50.0, 60.0, 120.0)


def is_live_link(path: Path) -> bool:
    """Whether a CSV begins as those of the Live Link Face app do."""
    with open(path, "rb") as file:
        return file.read(64).removeprefix(b"\xef\xbb\xbf").startswith(LIVE_LINK)


def read_livelink_motion(path: Path) -> Reading:
    """A take as curves with head and eyes; there is no sound in it.

    The gaze is the mean of both eyes; the angles of each stay, as six curves.
    Yaw is positive to the performer's right and pitch down, as the eyes' angles and looks in the app's own takes show.
    """
    require_file(path)
    names, timecodes, values = _table(path)
    weights = [column for column in names if column not in ANGLES]
    frames = np.clip(values[:, [names.index(column) for column in weights]], 0, 1)
    angles = values[:, [names.index(angle) for angle in ANGLES]].reshape(-1, 3, 3)
    layout = Layout("curves", tuple(column[0].lower() + column[1:] for column in (*weights, *EYE_ANGLES)))
    head = np.concatenate(
        [Rotation.from_euler("YXZ", angles[:, 0] * [-1, 1, -1]).as_rotvec(), np.zeros((len(values), 3))], axis=1
    )
    shut = [layout.names.index(name) for name in ("eyeBlinkLeft", "eyeBlinkRight") if name in layout.names]
    opening = 1 - frames[:, shut].mean(axis=1) if shut else np.ones(len(frames))
    eyes = np.column_stack([opening, -angles[:, 1:, :2].mean(axis=1)])
    still = () if np.any(angles[:, 0]) else ("the head angles are all zero: the app was told not to stream them",)
    frames = np.concatenate([frames, angles[:, 1:].reshape(len(frames), -1)], axis=1)
    return Reading(motion_of_arrays(path, frames, _rate(path, timecodes), layout, head, eyes), remarks=still, silent=True)


def _table(path: Path) -> tuple[list[str], list[str], NDArray[np.float64]]:
    """Names of the number columns, timecodes, and numbers [T, columns]."""
    try:
        with open(path, encoding="utf-8-sig", newline="") as file:
            header, *rows = [row for row in csv.reader(file, strict=True) if row] or [[]]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FacesynthError(f"{path} cannot be read as a Live Link Face CSV ({error})") from None
    names = header[2:]
    if tuple(header[:2]) != FIRST or len(set(names)) != len(names) or not set(ANGLES) < set(names) or "" in names:
        raise FacesynthError(f"{path} is no Live Link Face CSV: wanted Timecode, BlendshapeCount, weights and nine angles")
    for number, row in enumerate(rows, start=2):
        if len(row) != len(header):
            raise FacesynthError(f"{path}, line {number}: {len(row)} cells, but {len(header)} columns; was the take cut off?")
    try:
        values = np.array([row[2:] for row in rows], np.float64).reshape(len(rows), len(names))
    except ValueError as error:
        raise FacesynthError(f"{path} holds what is no number ({error})") from None
    if not len(rows) or not np.isfinite(values).all():
        raise FacesynthError(f"{path} holds no frames, or values that are not finite; record the take again")
    return names, [row[0].strip() for row in rows], values


def _rate(path: Path, timecodes: list[str]) -> float:
    """Frames per second: as many as the frame number of the timecode counts in a second, corrected by the clock."""
    fields = [_TIMECODE.fullmatch(text) for text in (timecodes[0], timecodes[-1], *timecodes)]
    if any(match is None for match in fields):
        raise FacesynthError(f"{path} holds a timecode that is not HH:MM:SS:FF.mmm")
    parts = np.array([[int(part or 0) for part in match.groups()[:4]] for match in fields if match], np.int64)
    highest = int(parts[2:, 3].max()) + 1
    counted = min((rate for rate in _RATES if rate >= highest), default=float(highest))
    clock = parts[:2] @ np.array([3600 * counted, 60 * counted, counted, 1])
    fraction = [float(f"0.{match.group(5) or 0}") for match in fields[:2] if match]
    elapsed = float(clock[1] + fraction[1] - clock[0] - fraction[0]) / counted % 86400
    if len(timecodes) < 2 or elapsed <= 0:
        raise FacesynthError(f"{path} is too short, or its timecodes do not go up, so its rate is not known")
    mean = (len(timecodes) - 1) / elapsed
    exact = [rate * slow for rate in _RATES for slow in (1.0, 1000 / 1001)]
    nearest = min(exact, key=lambda rate: abs(rate - mean))
    return nearest if abs(nearest - mean) < 1e-4 * mean else mean
