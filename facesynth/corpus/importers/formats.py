"""One recording of any known system."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from facesynth.corpus.importers.articulography import is_articulography, read_articulography
from facesynth.corpus.importers.beat import is_beat, read_beat
from facesynth.corpus.importers.c3d import read_c3d
from facesynth.corpus.importers.description import Description, Written, description_beside
from facesynth.corpus.importers.flame import is_flame, read_flame
from facesynth.corpus.importers.livelink import read_livelink_motion
from facesynth.corpus.importers.matlab import load_mat
from facesynth.corpus.importers.openface import is_openface, read_openface
from facesynth.corpus.importers.reading import Reading, motion_of_arrays, open_gaps, require_file
from facesynth.corpus.importers.tables import read_numbers, read_table
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.motion.arkit_names import ARKIT_NAMES
from facesynth.motion.livelink import FEWEST_SHAPES, as_shares, is_live_link

ARKIT = frozenset(map(str.lower, ARKIT_NAMES))


@dataclass(frozen=True)
class Asked:
    """What somebody says of a file that is read."""

    layout: Layout | None = None
    """What its channels are."""
    fps: float | None = None
    """Its rate, if it does not state one, Hz."""
    written: Written | None = None
    """How it is written."""
    otherwise: Layout | None = None
    """The layout of a table that names its channels nowhere."""

    def over(self, beside: Description | None) -> "Asked":
        """The same, completed by the description that lies beside the file."""
        if beside is None:
            return self
        return replace(self, layout=self.layout or beside.layout, written=(self.written or Written()).over(beside.written))


def _always(_: Path) -> bool:
    return True


def _never(_: Path) -> bool:
    return False


@dataclass(frozen=True)
class Format:
    """Motion files of one suffix."""

    read: Callable[[Path, Asked], Reading]
    """What is in such a file, which is there and not empty; FacesynthError for what it must not hold."""
    stands_alone: Callable[[Path], bool] = _never
    """Whether such a file may hold the sound as well, or is of use without; a sound lies beside any other."""
    knows: Callable[[Path], bool] = _always
    """Whether such a file is motion at all; what is none is not taken for a recording."""


def read(
    path: str | Path,
    layout: Layout | None = None,
    fps: float | None = None,
    written: Written | None = None,
    *,
    otherwise: Layout | None = None,
) -> Reading:
    """One recording of any known system; a FacesynthError names the file and says why it is none.

    layout, written: what its channels are and how it is written; where they say nothing, a `layout.yaml` in its folder.
    fps: its rate, if it does not state one. otherwise: the layout of a table that names its channels nowhere.
    """
    path = Path(path)
    require_file(path)
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        raise FacesynthError(f"{path} is none of {', '.join(sorted(FORMATS))}")
    try:
        return FORMATS[suffix].read(path, Asked(layout, fps, written, otherwise))
    except FacesynthError as error:
        if path.name in str(error):
            raise
        raise FacesynthError(f"{path}: {error}") from None


def _c3d(path: Path, asked: Asked) -> Reading:
    asked = asked.over(description_beside(path))
    return read_c3d(path, asked.layout, asked.written)


def _csv(path: Path, asked: Asked) -> Reading:
    if is_live_link(path):
        return read_livelink_motion(path, asked.fps)
    return read_openface(path, asked.fps) if is_openface(path) else _table(path, asked)


def _json(path: Path, asked: Asked) -> Reading:
    return read_beat(path, asked.fps)


def _npz(path: Path, asked: Asked) -> Reading:
    arrays = read_numbers(path)
    return read_flame(path, arrays) if is_flame(arrays) else _table(path, asked)


def _mat(path: Path, asked: Asked) -> Reading:
    return read_articulography(path) if is_articulography(load_mat(path)) else _table(path, asked)


def _table(path: Path, asked: Asked) -> Reading:
    asked = asked.over(description_beside(path))
    return _with_gaps(path, read_table(path, asked.layout, asked.fps, asked.written, otherwise=asked.otherwise))


def _with_gaps(path: Path, reading: Reading) -> Reading:
    """A table's points with gaps where it holds numbers for them, its curves with ARKit's weights as shares."""
    motion = reading.motion
    if motion.layout.kind == "curves":
        return _with_shares(path, reading)
    points, said = open_gaps(motion.points)
    frames = points.reshape(motion.frames.shape)
    opened = motion_of_arrays(path, frames, motion.fps, motion.layout, motion.head, motion.eyes)
    return replace(reading, motion=opened, remarks=(*reading.remarks, *said))


def _with_shares(path: Path, reading: Reading) -> Reading:
    """Curves whose weights under ARKit's names are shares of 1; what has other names is as it was measured."""
    motion = reading.motion
    are_weights = [name.lower() in ARKIT for name in motion.layout.names]
    if sum(are_weights) < FEWEST_SHAPES:
        return reading
    values, said = as_shares(path, np.nan_to_num(motion.frames.astype(np.float64)), are_weights)
    if not any("taken as per cent" in line for line in said):
        return reading
    frames = np.where(np.isnan(motion.frames), np.nan, values)
    shares = motion_of_arrays(path, frames, motion.fps, motion.layout, motion.head, motion.eyes)
    return replace(reading, motion=shares, remarks=(*reading.remarks, *said))


FORMATS: Mapping[str, Format] = {
    ".c3d": Format(_c3d, _always),
    ".csv": Format(_csv, is_live_link),
    ".json": Format(_json, knows=is_beat),
    ".mat": Format(_mat, _always),
    ".npz": Format(_npz),
}
"""Everything that is read as motion, by suffix in lower case: a new importer is a line here."""
