"""One recording of any known system."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from facesynth.corpus.importers.articulography import is_articulography, read_articulography
from facesynth.corpus.importers.beat import read_beat
from facesynth.corpus.importers.c3d import read_c3d
from facesynth.corpus.importers.description import Written, description_beside
from facesynth.corpus.importers.flame import is_flame, read_flame
from facesynth.corpus.importers.livelink import read_livelink_motion
from facesynth.corpus.importers.openface import is_openface, read_openface
from facesynth.corpus.importers.reading import Reading, motion_of_arrays, open_gaps, require_file
from facesynth.corpus.importers.tables import load_mat, read_numbers, read_table
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.motion.livelink import is_live_link

SUFFIXES = frozenset({".c3d", ".csv", ".npz", ".mat", ".json"})


def read(
    path: str | Path,
    layout: Layout | None = None,
    fps: float | None = None,
    written: Written | None = None,
    *,
    otherwise: Layout | None = None,
) -> Reading:
    """One recording of any known system; a FacesynthError says why a file is none.

    layout, written: what its channels are and how it is written; where they say nothing, a `layout.yaml` in its folder.
    fps: its rate, if it does not state one. otherwise: the layout of a table that names its channels nowhere.
    """
    path = Path(path)
    require_file(path)
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise FacesynthError(f"{path} is none of {', '.join(sorted(SUFFIXES))}")
    if (found := _described_by_itself(path, fps)) is not None:
        return found
    beside = description_beside(path)
    if beside is not None:
        layout = layout or beside.layout
        written = (written or Written()).over(beside.written)
    if suffix == ".c3d":
        return read_c3d(path, layout, written)
    return _with_gaps(path, read_table(path, layout, fps, written, otherwise=otherwise))


def _with_gaps(path: Path, reading: Reading) -> Reading:
    """A table's markers with gaps where it holds numbers for them."""
    motion = reading.motion
    if motion.layout.kind != "markers":
        return reading
    points, said = open_gaps(motion.points)
    frames = points.reshape(motion.frames.shape)
    opened = motion_of_arrays(path, frames, motion.fps, motion.layout, motion.head, motion.eyes)
    return replace(reading, motion=opened, remarks=(*reading.remarks, *said))


def _described_by_itself(path: Path, fps: float | None) -> Reading | None:
    """A recording of a system whose files say what their channels are; None for any other."""
    suffix = path.suffix.lower()
    if suffix == ".csv" and is_live_link(path):
        return read_livelink_motion(path, fps)
    if suffix == ".csv" and is_openface(path):
        return read_openface(path)
    if suffix == ".npz" and is_flame(arrays := read_numbers(path)):
        return read_flame(path, arrays)
    if suffix == ".mat" and is_articulography(load_mat(path)):
        return read_articulography(path)
    return read_beat(path) if suffix == ".json" else None
