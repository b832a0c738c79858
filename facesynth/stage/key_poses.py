"""Key poses of a performer: which frames are worth posing, the table in which somebody says the weights, what it teaches."""

import csv
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus import Corpus
from facesynth.corpus.motion_files import into_corpus, load_motion
from facesynth.face.files.npz import read_npz
from facesynth.face.solve.fitting import rest_of
from facesynth.face.solve.key_poses import KeyPoseMap, KeyPoses, worth_posing
from facesynth.inference.errors import FacesynthError, unknown
from facesynth.inference.head.keys import table_number
from facesynth.inference.motion import Motion
from facesynth.inference.npz import read_all_arrays

UTTERANCE, TIME, FRAME = "utterance", "time_s", "frame"
RATE = 10.0
"""Frames per second of the recordings that are looked at: neighbouring frames are nearly the same pose."""


def suggested(corpus: Corpus, count: int) -> list[tuple[str, float]]:
    """(utterance, time in s) of `count` frames of a corpus that differ most from rest and from each other."""
    motions = {name: corpus[name].motion for name in corpus.ids}
    places = [(name, k) for name, motion in motions.items() for k in _thinned(motion)]
    frames = np.stack([motions[name].frames[k] for name, k in places])
    chosen = worth_posing(frames, _rest(motions), count)
    return [(places[i][0], places[i][1] / corpus.fps) for i in chosen]


def table_to_fill(places: Sequence[tuple[str, float]], channels: Sequence[str]) -> str:
    """A table (CSV) of frames to pose, with an empty column for each channel of the head."""
    rows = [",".join([UTTERANCE, TIME, *channels])]
    rows += [",".join([name, f"{time_s:.3f}", *[""] * len(channels)]) for name, time_s in places]
    return "\n".join(rows) + "\n"


def read_key_poses(path: str | Path, corpus: Corpus, channels: Sequence[str] = ()) -> KeyPoses:
    """Key poses from a CSV (utterance, time_s or frame, a column for each channel) or an NPZ (frames, weights, names).

    channels: those of the head, where it is known; the table may leave some out, which then stay at 0.
    """
    path = Path(path)
    names, frames, weights = _from_npz(path) if path.suffix.lower() == ".npz" else _from_csv(path, corpus)
    for name in names if channels else ():
        if name not in channels:
            raise unknown("channel of the key poses", name, channels)
    wanted = tuple(channels) or names
    spread = np.zeros((len(weights), len(wanted)))
    spread[:, [wanted.index(name) for name in names]] = weights
    try:
        return KeyPoses(corpus.layout, wanted, frames, spread)
    except FacesynthError as error:
        raise FacesynthError(f"{path}: {error}") from None


def learned(poses: KeyPoses, corpus: Corpus) -> KeyPoseMap:
    """What key poses teach of a performer, with the components of all of its recordings."""
    motions = {name: corpus[name].motion for name in corpus.ids}
    recorded = np.concatenate([motion.frames[_thinned(motion)] for motion in motions.values()])
    return KeyPoseMap.fit(poses, _rest(motions), recorded)


def motion_of(name: str, corpus: Corpus) -> Motion:
    """A motion of the performer: an utterance of its corpus, an `.npz` that `speak` wrote, or any motion file."""
    if name in corpus:
        return corpus[name].motion
    path = Path(name)
    if not path.is_file():
        raise FacesynthError(f"{name} is neither an utterance of the corpus nor a file")
    if path.suffix.lower() == ".npz" and "layout" in read_all_arrays(path, "a motion"):
        motion = read_npz(path)[1]
        if motion is not None:
            return into_corpus(motion, corpus.layout, corpus.fps)[0]
    return load_motion(path, corpus.layout, corpus.fps)[0]


def _thinned(motion: Motion) -> NDArray[np.int64]:
    """Frames without missing samples, about `RATE` a second."""
    some = np.arange(0, len(motion), max(1, round(motion.fps / RATE)))
    return some[np.isfinite(motion.frames[some]).all(axis=1)]


def _rest(motions: dict[str, Motion]) -> NDArray[np.float64]:
    """[C] the layout's rest pose, else that of all recordings together."""
    first = next(iter(motions.values()))
    return rest_of(replace(first, frames=np.concatenate([m.frames for m in motions.values()]), head=None, eyes=None))


def _from_npz(path: Path) -> tuple[tuple[str, ...], NDArray[np.float64], NDArray[np.float64]]:
    arrays = read_all_arrays(path, "key poses")
    lacking = [name for name in ("frames", "weights", "names") if name not in arrays]
    if lacking:
        raise FacesynthError(f"{path} lacks {', '.join(lacking)}; key poses are frames [K, C], weights [K, N] and N names")
    frames = arrays["frames"].reshape(len(arrays["frames"]), -1)
    names = tuple(str(name) for name in np.atleast_1d(arrays["names"]))
    if arrays["weights"].shape != (len(frames), len(names)):
        raise FacesynthError(
            f"{path}: wanted weights [{len(frames)}, {len(names)}], a row for each frame and a column for each name;"
            f" got {list(arrays['weights'].shape)}"
        )
    return names, frames, arrays["weights"]


def _from_csv(path: Path, corpus: Corpus) -> tuple[tuple[str, ...], NDArray[np.float64], NDArray[np.float64]]:
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            header, *rows = [[cell.strip() for cell in row] for row in csv.reader(file) if any(row)] or [[]]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FacesynthError(f"{path} cannot be read as a table of key poses ({error})") from None
    clock = next((name for name in (TIME, FRAME) if name in header), None)
    if UTTERANCE not in header or clock is None or len(set(header)) != len(header):
        raise FacesynthError(f"{path}: wanted {UTTERANCE}, {TIME} (or {FRAME}) and a column for each channel; got {header[:4]}")
    names = tuple(name for name in header if name not in (UTTERANCE, TIME, FRAME))
    frames, weights = [], []
    for line, row in enumerate(rows, start=2):
        if len(row) != len(header):
            raise FacesynthError(f"{path}, line {line}: {len(row)} cells, but {len(header)} columns")
        cells = dict(zip(header, row, strict=True))
        at = table_number(path, line, clock, cells[clock])
        motion = corpus[cells[UTTERANCE]].motion
        frames.append(_frame(path, line, motion, at if clock == FRAME else at * motion.fps))
        weights.append([table_number(path, line, name, cells[name]) for name in names])
    shape = (len(rows), len(names))
    return names, np.reshape(frames, (len(rows), -1)), np.reshape(np.array(weights, np.float64), shape)


def _frame(path: Path, line: int, motion: Motion, at: float) -> NDArray[np.float32]:
    if not 0 <= round(at) < len(motion):
        raise FacesynthError(f"{path}, line {line}: the recording ends after {len(motion)} frames ({motion.duration_s:.2f} s)")
    return motion.frames[round(at)]
