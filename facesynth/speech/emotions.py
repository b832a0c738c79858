"""Emotions over time in files: CSV with a header, and lines of `end emotion`."""

import csv
import io
from pathlib import Path

import numpy as np

from facesynth.atomic import write_text
from facesynth.inference.errors import FacesynthError, unknown
from facesynth.inference.speech import NEUTRAL, EmotionTrack

_COLUMNS = ("start_s", "end_s", "emotion", "intensity")
_TOUCHING_S = 1e-6

Row = tuple[float, str, float]
"""End in seconds, emotion, intensity."""


def read_emotions(path: str | Path, duration_s: float) -> EmotionTrack:
    """Emotions from 0 to `duration_s` seconds, from a CSV or from lines of `end emotion`.

    The CSV's header names `end_s` and `emotion`, and may name `start_s` and `intensity` (1 where it does not).
    Time that no line speaks of is neutral; the last emotion without a `start_s` goes on to the end of the sound;
    what lies beyond the sound is cut. FacesynthError names the line that cannot be used.
    """
    path = Path(path)
    if not path.is_file():
        raise FacesynthError(f"{path}: no such file of emotions")
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise FacesynthError(f"{path} is not text in UTF-8; expected a CSV of end_s,emotion,intensity") from None
    first = next((line for line in text.splitlines() if line.strip()), "")
    rows = _csv_rows(path, text) if "emotion" in first.lower().replace(" ", "").split(",") else _plain_rows(path, text)
    return _track(path, rows, duration_s)


def write_emotions(path: str | Path, emotions: EmotionTrack) -> None:
    """Write `end_s,emotion,intensity` lines, atomically; `read_emotions` gives the same back."""
    lines = zip(emotions.ends_s, emotions.labels, emotions.intensities, strict=True)
    write_text(path, "end_s,emotion,intensity\n" + "".join(f"{end:.6f},{label},{value:.6g}\n" for end, label, value in lines))


def _csv_rows(path: Path, text: str) -> list[Row]:
    reader = csv.DictReader(io.StringIO(text), skipinitialspace=True)
    columns = [(name or "").strip().lower() for name in reader.fieldnames or ()]
    for name in columns:
        if name not in _COLUMNS:
            raise FacesynthError(f"{path}, line 1: {unknown('column', name, _COLUMNS)}")
    if "end_s" not in columns:
        raise FacesynthError(f"{path}, line 1: the column end_s is missing; the header is end_s,emotion,intensity")
    reader.fieldnames = columns
    rows: list[Row] = []
    for entry in reader:
        values = {key: (value or "").strip() for key, value in entry.items() if key is not None}
        if any(values.values()):
            _append(path, reader.line_num, rows, values, surplus=None in entry)
    return rows


def _plain_rows(path: Path, text: str) -> list[Row]:
    rows: list[Row] = []
    for number, line in enumerate(text.splitlines(), start=1):
        fields = line.split()
        if fields and not fields[0].startswith("#"):
            values = dict(zip(("end_s", "emotion", "intensity"), fields, strict=False))
            _append(path, number, rows, values, surplus=len(fields) > 3)
    return rows


def _append(path: Path, number: int, rows: list[Row], values: dict[str, str], surplus: bool) -> None:
    """Add what a line says, after a neutral stretch where it starts later than the line before ends."""
    before_s = rows[-1][0] if rows else 0.0
    said = " ".join(values.values())
    try:
        end_s, intensity = float(values["end_s"]), float(values.get("intensity") or 1)
        start_s = float(values.get("start_s") or before_s)
    except (KeyError, ValueError):
        raise FacesynthError(f"{path}, line {number}: {said!r} is not an end in seconds, an emotion and an intensity") from None
    emotion = values.get("emotion", "").lower()
    if not emotion or surplus:
        raise FacesynthError(f"{path}, line {number}: {said!r} needs one emotion, and nothing after the intensity")
    if not (before_s - _TOUCHING_S <= start_s < end_s < np.inf):
        raise FacesynthError(
            f"{path}, line {number}: {start_s:g} to {end_s:g} s does not follow the line before, to {before_s:g} s"
        )
    if not 0 <= intensity <= 1:
        raise FacesynthError(f"{path}, line {number}: intensity {intensity:g} does not lie from 0 to 1")
    if start_s > before_s + _TOUCHING_S:
        rows.append((start_s, NEUTRAL, 1.0))
    rows.append((end_s, emotion, intensity))


def _track(path: Path, rows: list[Row], duration_s: float) -> EmotionTrack:
    """Rows cut at the end of the sound; the last goes on where they end before it."""
    if not rows:
        raise FacesynthError(f"{path} names no emotion; expected lines of end_s,emotion,intensity")
    starts = [0.0] + [end for end, _, _ in rows[:-1]]
    kept = [row for row, start in zip(rows, starts, strict=True) if start < duration_s - _TOUCHING_S]
    ends = [end for end, _, _ in kept[:-1]] + [duration_s]
    return EmotionTrack(tuple(row[1] for row in kept), np.array(ends), np.array([row[2] for row in kept]))
