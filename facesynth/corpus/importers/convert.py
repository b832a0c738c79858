"""Recordings of other systems, written as the plain files that `facesynth corpus add` reads."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from facesynth.atomic import atomic_path, write_text
from facesynth.corpus.importers.articulography import is_articulography, read_articulography
from facesynth.corpus.importers.c3d import read_c3d
from facesynth.corpus.importers.flame import is_flame, read_flame
from facesynth.corpus.importers.livelink import is_livelink, read_livelink_motion
from facesynth.corpus.importers.reading import Reading, require_file
from facesynth.corpus.importers.tables import load_mat, read_arrays, read_table
from facesynth.errors import FacesynthError
from facesynth.motion.layout import Layout
from facesynth.progress import track
from facesynth.speech.audio import save_wav
from facesynth.speech.textgrid import write_textgrid

SUFFIXES = frozenset({".c3d", ".csv", ".npz", ".mat"})
LAYOUT = "layout.yaml"


@dataclass(frozen=True)
class ConvertReport:
    """What became of each file."""

    converted: tuple[str, ...] = ()
    refused: Mapping[str, str] = field(default_factory=dict)
    remarks: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    fps: float = 0.0
    """Rate of the first recording, Hz."""


def convert(
    paths: Iterable[str | Path],
    folder: str | Path,
    *,
    layout: Layout | None = None,
    fps: float | None = None,
    axes: str = "x,y,z",
) -> ConvertReport:
    """Read every C3D, CSV, NPZ and MAT of files and folders; write motion, sound, phones and words as far as they hold them.

    The layout of the first recording is written beside them as `layout.yaml`; recordings of another one are refused,
    as is what cannot be read, each with the reason; the others are converted.
    """
    folder = Path(folder)
    converted: list[str] = []
    refused: dict[str, str] = {}
    remarks: dict[str, tuple[str, ...]] = {}
    first: Reading | None = None
    for path in track(_files(paths), "converting"):
        try:
            reading = read(path, layout, fps, axes)
            _require_same(first, reading, path)
        except FacesynthError as error:
            refused[path.name] = str(error)
            continue
        first = first or reading
        _write(folder, path.stem, reading)
        converted.append(path.stem)
        remarks |= {path.stem: reading.remarks} if reading.remarks else {}
    if first is not None:
        write_text(folder / LAYOUT, _yaml(first.motion.layout))
    return ConvertReport(tuple(converted), refused, remarks, 0.0 if first is None else first.motion.fps)


def read(path: str | Path, layout: Layout | None = None, fps: float | None = None, axes: str = "x,y,z") -> Reading:
    """One recording of any known system; a FacesynthError says why a file is none."""
    path = Path(path)
    require_file(path)
    suffix = path.suffix.lower()
    if suffix == ".c3d":
        return read_c3d(path, layout, axes)
    if suffix == ".csv" and is_livelink(path):
        return read_livelink_motion(path)
    if suffix == ".npz" and is_flame(arrays := read_arrays(path)):
        return read_flame(path, arrays)
    if suffix == ".mat" and is_articulography(load_mat(path)):
        return read_articulography(path)
    if suffix not in SUFFIXES:
        raise FacesynthError(f"{path} is none of {', '.join(sorted(SUFFIXES))}")
    return read_table(path, layout, fps)


def _files(paths: Iterable[str | Path]) -> list[Path]:
    found: list[Path] = []
    for path in map(Path, paths):
        if path.is_dir():
            found += sorted(file for file in path.iterdir() if file.suffix.lower() in SUFFIXES and not file.name.startswith("."))
        else:
            found.append(path)
    return found


def _require_same(first: Reading | None, reading: Reading, path: Path) -> None:
    if first is None:
        return
    kept, own = first.motion.layout, reading.motion.layout
    if (kept.kind, kept.names) != (own.kind, own.names):
        odd = sorted(set(kept.names) ^ set(own.names))[:3]
        raise FacesynthError(
            f"{path} has other channels than the first recording ({', '.join(odd)}); give a layout file for both"
        )


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


def _yaml(layout: Layout) -> str:
    import yaml

    return str(yaml.safe_dump(layout.to_dict(), sort_keys=False, allow_unicode=True, default_flow_style=None, width=120))
