"""Shapes kept in the user's cache: following points is by far the slowest step, and depends on the video and the points alone."""

import hashlib
from pathlib import Path

import numpy as np

from facesynth.atomic import atomic_path
from facesynth.cache import cache_dir
from facesynth.capture.points.footage import Footage, read_footage
from facesynth.capture.points.reference import Following, Reference
from facesynth.capture.points.shapes import Shapes
from facesynth.capture.points.tracking import Drift
from facesynth.hashing import hash_file
from facesynth.inference.errors import FacesynthError
from facesynth.inference.npz import read_arrays
from facesynth.motion.planar import HeadMaps

VERSION = 3
"""Raised where following changes its results, so that old shapes are not used any more."""


def kept_shapes(video: Path, reference: Reference) -> tuple[Shapes, Following, bool]:
    """What `Reference.find` gives for a video, from the cache where it was found before; and whether its rate was evened out."""
    kept = _place(video, reference)
    found = _read(kept)
    if found is None:
        footage = read_footage(video)
        shapes, following = _found(reference, footage, video)
        found = shapes, following, footage.resampled
        save_shapes(kept, *found)
    return found


def save_shapes(path: Path, shapes: Shapes, following: Following, resampled: bool) -> None:
    """Write one .npz, atomically."""
    drift = following.drift
    figures = (following.lost_share, drift.median_px, drift.worst_tenth_px, drift.lost_share, float(resampled))
    with atomic_path(path) as part, open(part, "wb") as file:
        np.savez(
            file,
            points=shapes.points.astype(np.float32),
            linear=shapes.head.linear,
            shift=shapes.head.shift,
            fps=shapes.fps,
            figures=np.array(figures),
        )


def load_shapes(path: Path) -> Shapes:
    """The shapes that `save_shapes` wrote; FacesynthError for anything else."""
    found = _read(path)
    if found is None:
        raise FacesynthError(f"{path} is missing or damaged; add the video to the corpus again")
    return found[0]


def _found(reference: Reference, footage: Footage, video: Path) -> tuple[Shapes, Following]:
    try:
        return reference.find(footage)
    except FacesynthError as error:
        raise FacesynthError(f"{video}: {error}") from None


def _place(video: Path, reference: Reference) -> Path:
    if not video.is_file():
        raise FacesynthError(f"{video}: no such file")
    made_by = hashlib.sha256(f"{VERSION} {reference.mouth} {reference.face}".encode())
    for array in (reference.picture, reference.points, reference.mean):
        made_by.update(np.ascontiguousarray(array).tobytes())
    return cache_dir("tracks") / f"{hash_file(video)[:32]}-points-{made_by.hexdigest()[:16]}.npz"


def _read(kept: Path) -> tuple[Shapes, Following, bool] | None:
    """None where there is nothing, or something damaged."""
    try:
        stored = read_arrays(kept, "a file of followed shapes", ("points", "fps", "linear", "shift", "figures"))
    except FacesynthError:
        return None
    count = len(np.atleast_1d(stored["points"]))
    wanted = {"linear": (count, 2, 2), "shift": (count, 2), "figures": (5,), "fps": ()}
    if stored["points"].ndim != 3 or any(stored[name].shape != shape for name, shape in wanted.items()):
        return None
    lost, median, worst, drifted, resampled = stored["figures"].tolist()
    head = HeadMaps(stored["linear"].astype(np.float64), stored["shift"].astype(np.float64))
    shapes = Shapes(stored["points"].astype(np.float64), head, float(stored["fps"]))
    return shapes, Following(lost, Drift(median, worst, drifted)), bool(resampled)
