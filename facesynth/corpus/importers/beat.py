"""Weights of a face as BEAT keeps them: JSON with names, and frames that hold weights and a time each."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from facesynth.corpus.importers.reading import Reading, motion_of_arrays, require_file
from facesynth.corpus.importers.timed import at_steady_rate
from facesynth.corpus.motion_files import shortened
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.motion.arkit_names import ARKIT_NAMES
from facesynth.motion.livelink import FEWEST_SHAPES, as_shares

HEAD_BYTES = 1 << 16
_SPELLED = {name.lower(): name for name in ARKIT_NAMES}


def is_beat(path: Path) -> bool:
    """Whether a JSON file holds frames of weights."""
    with open(path, "rb") as file:
        head = file.read(HEAD_BYTES)
    return b'"frames"' in head and b'"weights"' in head


def read_beat(path: Path) -> Reading:
    """Curves by name; of ARKit's 52 shapes those that the file lacks are 0."""
    require_file(path)
    names, weights, times_s = _content(path)
    weights, said = as_shares(path, weights, [True] * len(names))
    lacking = [name for name in ARKIT_NAMES if name not in names]
    if len(ARKIT_NAMES) - len(lacking) < FEWEST_SHAPES:
        lacking = []
    if lacking:
        said = [*said, f"{len(lacking)} of ARKit's {len(ARKIT_NAMES)} shapes are not in it and stay 0: {shortened(lacking)}"]
    whole = np.concatenate([np.clip(weights, 0, 1), np.zeros((len(weights), len(lacking)))], axis=1)
    frames, fps, remarks = at_steady_rate(path, whole, times_s)
    motion = motion_of_arrays(path, frames, fps, Layout("curves", (*names, *lacking)))
    return Reading(motion, remarks=(*said, *remarks))


def _content(path: Path) -> tuple[tuple[str, ...], Any, Any]:
    """Names, weights [T, C] and times [T] s."""
    try:
        plain = json.loads(path.read_bytes())
        names = tuple(_SPELLED.get(str(name).lower(), str(name)) for name in plain["names"])
        weights = np.array([frame["weights"] for frame in plain["frames"]], np.float64)
        times_s = np.array([frame["time"] for frame in plain["frames"]], np.float64)
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        reason = f"it lacks {error}" if isinstance(error, KeyError) else " ".join(str(error).split())[:160]
        raise FacesynthError(f"{path} holds no frames of weights as BEAT keeps them ({reason})") from None
    if weights.ndim != 2 or weights.shape[1] != len(names) or len(set(names)) != len(names) or times_s.shape != weights.shape[:1]:
        raise FacesynthError(f"{path} names {len(names)} shapes, its frames hold weights of shape {list(weights.shape)}")
    if not np.isfinite(weights).all():
        raise FacesynthError(f"{path} holds NaN or infinite weights; export it again")
    return names, weights, times_s
