"""One recording of any known system."""

from __future__ import annotations

from pathlib import Path

from facesynth.corpus.importers.articulography import is_articulography, read_articulography
from facesynth.corpus.importers.c3d import read_c3d
from facesynth.corpus.importers.description import Written, description_beside
from facesynth.corpus.importers.flame import is_flame, read_flame
from facesynth.corpus.importers.livelink import read_livelink_motion
from facesynth.corpus.importers.reading import Reading, require_file
from facesynth.corpus.importers.tables import load_mat, read_numbers, read_table
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.motion.livelink import is_live_link

SUFFIXES = frozenset({".c3d", ".csv", ".npz", ".mat"})


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
    if suffix == ".csv" and is_live_link(path):
        return read_livelink_motion(path, fps)
    if suffix == ".npz" and is_flame(arrays := read_numbers(path)):
        return read_flame(path, arrays)
    if suffix == ".mat" and is_articulography(load_mat(path)):
        return read_articulography(path)
    beside = description_beside(path)
    if beside is not None:
        layout = layout or beside.layout
        written = (written or Written()).over(beside.written)
    if suffix == ".c3d":
        return read_c3d(path, layout, written)
    return read_table(path, layout, fps, written, otherwise=otherwise)
