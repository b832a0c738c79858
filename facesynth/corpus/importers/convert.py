"""Recordings of other systems, written as the plain files that `facesynth corpus add` reads."""

import shutil
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from facesynth.atomic import atomic_path, write_text
from facesynth.corpus.add.recordings import AUDIO, VIDEO, Recording, find_recordings
from facesynth.corpus.importers.description import LAYOUT, Description, description_text
from facesynth.corpus.importers.formats import FORMATS, read
from facesynth.corpus.importers.reading import Reading
from facesynth.corpus.importers.session import Session, survey
from facesynth.corpus.motion_files import with_points_of
from facesynth.inference.errors import FacesynthError
from facesynth.progress import track
from facesynth.speech.audio import read_sound, save_wav
from facesynth.speech.textgrid import write_textgrid


@dataclass(frozen=True)
class ConvertReport:
    """What became of each file."""

    converted: tuple[str, ...] = ()
    refused: Mapping[str, str] = field(default_factory=dict)
    remarks: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    fps: float = 0.0
    """Rate of most recordings, Hz."""
    guessed: tuple[str, ...] = ()
    """What nobody said of the markers."""


def convert(
    paths: Iterable[str | Path], folder: str | Path, *, description: Description | None = None, fps: float | None = None
) -> ConvertReport:
    """Read every motion file among files and in folders; write motion, sound, phones and words in or beside them.

    The layout that most recordings share is written beside them as `layout.yaml`, with the rest pose of all; those that
    lack channels of it are refused, as is what cannot be read, each with the reason; the others are converted.
    """
    folder, paths = Path(folder), list(paths)
    files = _files(paths)
    converted: list[str] = []
    refused: dict[str, str] = {}
    remarks: dict[str, tuple[str, ...]] = {}
    session = _survey(files, description, fps)
    beside = {found.motion.resolve(): found for found in _recordings(paths)}
    for path in track(files, "converting"):
        try:
            if session is None:
                session = survey([path], description, fps)
            said = _convert(folder, path, session, description, fps, beside.get(path.resolve()))
        except FacesynthError as error:
            refused[path.name] = str(error)
            continue
        converted.append(path.stem)
        remarks |= {path.stem: said} if said else {}
    if session is None or not converted:
        return ConvertReport((), refused, remarks)
    write_text(folder / LAYOUT, description_text(Description(session.layout)))
    return ConvertReport(tuple(converted), refused, remarks, session.fps, session.remarks)


def _survey(files: list[Path], description: Description | None, fps: float | None) -> Session | None:
    """What the files have in common; None where none can be read."""
    try:
        return survey(files, description, fps)
    except FacesynthError:
        return None


def _recordings(paths: Iterable[str | Path]) -> list[Recording]:
    try:
        return find_recordings(paths)[0]
    except FacesynthError:
        return []


def _convert(
    folder: Path, path: Path, session: Session, description: Description | None, fps: float | None, beside: Recording | None
) -> tuple[str, ...]:
    reading = read(path, description.layout if description else None, fps, session.written)
    try:
        motion, remarks = with_points_of(session.layout, reading.motion)
    except FacesynthError as error:
        raise FacesynthError(f"{path} has other channels than most recordings: {error}") from None
    _write(folder, path.stem, replace(reading, motion=motion))
    if beside is not None:
        remarks = (*remarks, *_carry(folder, path.stem, beside))
    return (*reading.remarks, *remarks)


def _carry(folder: Path, name: str, beside: Recording) -> tuple[str, ...]:
    """Bring along what lies beside a recording: its sound, unless it is in the motion's file; phones, words, emotions.

    Returns what was noticed.
    """
    remarks: tuple[str, ...] = ()
    if beside.sound != beside.motion:
        if beside.sound.suffix.lower() in VIDEO:
            sound = read_sound(beside.sound)
            save_wav(folder / f"{name}.wav", sound.audio, sound.sample_rate)
            remarks = sound.remarks
        elif beside.sound.suffix.lower() in AUDIO:
            _copy(beside.sound, folder / f"{name}{beside.sound.suffix}")
    for path, suffix in ((beside.phones, ""), (beside.text, ""), (beside.emotions, ".emotions.csv")):
        if path is not None:
            _copy(path, folder / f"{name}{suffix or path.suffix}")
    return remarks


def _copy(source: Path, target: Path) -> None:
    if source.resolve() != target.resolve():
        with atomic_path(target) as part:
            shutil.copyfile(source, part)


def _files(paths: Iterable[str | Path]) -> list[Path]:
    found: list[Path] = []
    for path in map(Path, paths):
        if path.is_dir():
            found += sorted(file for file in path.iterdir() if file.suffix.lower() in FORMATS and not file.name.startswith("."))
        elif path.suffix.lower() in FORMATS or not path.is_file():
            found.append(path)
    return found


def _write(folder: Path, name: str, reading: Reading) -> None:
    motion = reading.motion
    arrays: dict[str, Any] = {"frames": motion.frames, "fps": np.float64(motion.fps)}
    arrays |= {key: value for key, value in (("head", motion.head), ("eyes", motion.eyes)) if value is not None}
    with atomic_path(folder / f"{name}.npz") as part, open(part, "wb") as file:
        np.savez(file, **arrays)
    if reading.sound is not None:
        save_wav(folder / f"{name}.wav", reading.sound.audio, reading.sound.sample_rate)
    if reading.phones is not None:
        write_textgrid(folder / f"{name}.TextGrid", reading.phones, reading.words)
    if reading.text:
        write_text(folder / f"{name}.txt", reading.text + "\n")
