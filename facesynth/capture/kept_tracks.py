"""Tracks kept in the user's cache: following a face is by far the slowest step, and depends on the video alone."""

import hashlib
from pathlib import Path

import numpy as np

from facesynth.atomic import atomic_path
from facesynth.cache import cache_dir
from facesynth.capture.models import MODELS
from facesynth.capture.track import Track, track_face
from facesynth.hashing import hash_file
from facesynth.inference.errors import FacesynthError
from facesynth.inference.npz import read_arrays

VERSION = 2
"""Raised where tracking changes its results, so that old tracks are not used any more."""


def kept_track(path: str | Path, face: int | None = None) -> Track:
    """What `track_face` gives; from the cache where the same file was followed before."""
    path = Path(path)
    if not path.is_file():
        return track_face(path, face)
    kept = _place(path, face)
    track = _read(kept)
    if track is None:
        track = track_face(path, face)
        with atomic_path(kept) as part, open(part, "wb") as file:
            np.savez(file, **vars(track))
    return track


def _place(path: Path, face: int | None) -> Path:
    made_by = hashlib.sha256("".join([str(VERSION), str(face), *(model.sha256 for model in MODELS.values())]).encode())
    return cache_dir("tracks") / f"{hash_file(path)[:32]}-{made_by.hexdigest()[:8]}.npz"


def _read(kept: Path) -> Track | None:
    """The track, or None where there is none or it is damaged."""
    try:
        stored = read_arrays(kept, "a track", ("points_px", "irises_px", "fps", "damaged", "steps_s"))
    except FacesynthError:
        return None
    shortest_s, longest_s = stored["steps_s"].tolist()
    return Track(stored["points_px"], stored["irises_px"], float(stored["fps"]), int(stored["damaged"]), (shortest_s, longest_s))
