"""Video of a speaker, at a steady rate, on the clock of its sound, and in one piece."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.capture.square import Image
from facesynth.capture.video import open_video
from facesynth.inference.errors import FacesynthError

UNSTEADY = 0.25
"""Of the median step between frames: steps that differ by more make the rate variable."""
STRAY = 0.25
"""Frames by which the rate that a file states may be wrong at its end; otherwise the time stamps tell the rate."""
CUT_LEVEL = 8.0
"""Mean change of brightness (0..255) from one frame to the next above which …"""
CUT_RATIO = 5.0
"""… and this many times the median change, there is a cut."""
LARGEST_CLIP_BYTES = 1_500_000_000
"""Of all pictures of a clip together; they are held in memory."""


@dataclass(frozen=True, eq=False)
class Footage:
    """The pictures of one clip; picture i lies at i / fps on the clock of the sound."""

    frames: NDArray[np.uint8]
    """[T, H, W, 3] RGB."""
    fps: float
    """Hz."""
    resampled: bool
    """Whether the file's rate varied and the nearest picture was taken for each regular time."""


def read_footage(path: str | Path) -> Footage:
    """Read a clip of any container and rate; FacesynthError for no video in it, a cut in the middle, or damage."""
    path = Path(path)
    frames: list[Image] = []
    times: list[float] = []
    with open_video(path) as video:
        for time_s, image in video.images:
            if len(frames) * image.nbytes > LARGEST_CLIP_BYTES:
                raise FacesynthError(f"{path} is longer than can be held in memory; cut it into clips of a sentence or two")
            if not times or time_s > times[-1]:
                frames.append(image)
                times.append(time_s)
        nominal_fps = video.fps
    if len(frames) < 2:
        raise FacesynthError(f"{path} has {len(frames)} pictures; a moving face needs at least 2")
    footage = steady(np.stack(frames), times, nominal_fps)
    refuse_cuts(footage, str(path))
    return footage


def steady(frames: NDArray[np.uint8], times_s: Sequence[float], nominal_fps: float) -> Footage:
    """Frames [T, H, W, 3] at a steady rate from time 0: as they are, or the nearest to each regular time where steps vary."""
    times = np.array(times_s, np.float64)
    steps = np.diff(times)
    typical = float(np.median(steps))
    even = (np.abs(steps - typical) <= UNSTEADY * typical).all()
    fps = (len(times) - 1) / (times[-1] - times[0]) if even else 1 / typical
    if abs(nominal_fps / fps - 1) * len(times) < STRAY:
        fps = nominal_fps
    if even and abs(times[0]) <= 0.5 / fps:
        return Footage(frames, fps, resampled=False)
    regular = np.arange(0, times[-1] + 0.5 / fps, 1 / fps)
    return Footage(frames[np.abs(regular[:, None] - times).argmin(axis=1)], fps, resampled=not even)


def refuse_cuts(footage: Footage, name: str) -> None:
    """FacesynthError where one picture has little to do with the one before it."""
    small = footage.frames[:, ::8, ::8].astype(np.float32).mean(axis=3)
    change = np.abs(np.diff(small, axis=0)).mean(axis=(1, 2))
    cuts = np.flatnonzero((change > CUT_LEVEL) & (change > CUT_RATIO * np.median(change)))
    if len(cuts):
        at = (cuts[0] + 1) / footage.fps
        raise FacesynthError(f"{name} has a cut at {at:.2f} s (picture {cuts[0] + 1}); split it there and give the parts")
