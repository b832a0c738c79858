"""Video of a speaker, at a steady rate, on the clock of its sound, and in one piece."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.capture.square import Image
from facesynth.capture.video import open_video
from facesynth.inference.errors import FacesynthError
from facesynth.motion.gaps import LONGEST_S
from facesynth.motion.irregular import ROUNDING_S, read_at, steady_rate

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
    taken_s: NDArray[np.float64] | None = None
    """[T] when picture i was really taken; None: at i / fps."""

    def at_regular_times(self, points: NDArray[np.float32]) -> NDArray[np.float32]:
        """Points [T, K, 2] found in the pictures, moved to where they were at i / fps."""
        if self.taken_s is None:
            return points
        taken_s, first = np.unique(self.taken_s, return_index=True)
        found = points[first]
        regular_s = np.arange(len(points)) / self.fps
        moved = np.stack([_between(found[:, pair], taken_s, regular_s) for pair in range(points.shape[1])], axis=1)
        return moved.astype(np.float32)


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
    fps, even = steady_rate(times, nominal_fps)
    if even and abs(times[0]) <= ROUNDING_S:
        return Footage(frames, fps, resampled=False)
    regular = np.arange(0, times[-1] + 0.5 / fps, 1 / fps)
    nearest = np.abs(regular[:, None] - times).argmin(axis=1)
    return Footage(frames[nearest], fps, resampled=not even, taken_s=times[nearest])


def _between(point: NDArray[np.float32], taken_s: NDArray[np.float64], wanted_s: NDArray[np.float64]) -> NDArray[np.float32]:
    """One point [T, 2] at other times: on a spline between pictures that are near, on a line over pauses; held at the ends."""
    found = read_at(point, taken_s, wanted_s, LONGEST_S, ROUNDING_S)
    seen = np.isfinite(point).all(axis=1)
    if seen.any():
        for values, own in zip(found.T, point[seen].T, strict=True):
            lacking = np.isnan(values)
            values[lacking] = np.interp(wanted_s[lacking], taken_s[seen], own)
    return found


def refuse_cuts(footage: Footage, name: str) -> None:
    """FacesynthError where one picture has little to do with the one before it."""
    small = footage.frames[:, ::8, ::8].astype(np.float32).mean(axis=3)
    change = np.abs(np.diff(small, axis=0)).mean(axis=(1, 2))
    cuts = np.flatnonzero((change > CUT_LEVEL) & (change > CUT_RATIO * np.median(change)))
    if len(cuts):
        at = (cuts[0] + 1) / footage.fps
        raise FacesynthError(f"{name} has a cut at {at:.2f} s (picture {cuts[0] + 1}); split it there and give the parts")
