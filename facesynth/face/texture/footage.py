"""Video of a speaker, at a steady rate and in one piece."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.errors import FacesynthError

UNSTEADY = 0.25
"""Of the median step between frames: steps that differ by more make the rate variable."""
CUT_LEVEL = 8.0
"""Mean change of brightness (0..255) from one frame to the next above which …"""
CUT_RATIO = 5.0
"""… and this many times the median change, there is a cut."""


@dataclass(frozen=True, eq=False)
class Footage:
    """The pictures of one clip."""

    frames: NDArray[np.uint8]
    """[T, H, W, 3] RGB."""
    fps: float
    """Hz."""
    resampled: bool
    """Whether the file's rate varied and the nearest picture was taken for each regular time."""

    @property
    def grey(self) -> NDArray[np.uint8]:
        """[T, H, W] brightness."""
        return np.stack([(frame @ np.array([0.299, 0.587, 0.114])).round().astype(np.uint8) for frame in self.frames])


def read_footage(path: str | Path) -> Footage:
    """Read a clip of any container and rate; FacesynthError for no video in it, a cut in the middle, or damage."""
    import av

    try:
        with av.open(str(path)) as container:
            if not container.streams.video:
                raise FacesynthError(f"{path} has sound but no video; give a file with a picture")
            stream = container.streams.video[0]
            nominal = float(stream.average_rate or stream.guessed_rate or 0)
            frames, times = [], []
            for frame in container.decode(stream):
                frames.append(frame.to_ndarray(format="rgb24"))
                times.append(frame.time)
    except (av.FFmpegError, OSError) as error:
        raise FacesynthError(f"{path} cannot be read as a video ({error})") from None
    if len(frames) < 2:
        raise FacesynthError(f"{path} has {len(frames)} pictures; a moving face needs at least 2")
    footage = steady(np.stack(frames), times, nominal)
    refuse_cuts(footage, str(path))
    return footage


def steady(frames: NDArray[np.uint8], times_s: Sequence[float | None], nominal_fps: float) -> Footage:
    """Frames [T, H, W, 3] at a steady rate: as they are, or the nearest to each regular time where steps vary."""
    if any(time is None for time in times_s):
        return Footage(frames, nominal_fps, resampled=False)
    times = np.array(times_s, np.float64) - float(times_s[0] or 0)
    steps = np.diff(times)
    typical = float(np.median(steps))
    if typical <= 0:
        raise FacesynthError("the video's time stamps do not increase; convert it to a constant frame rate")
    if (np.abs(steps - typical) <= UNSTEADY * typical).all():
        fps = (len(times) - 1) / times[-1]
        return Footage(frames, nominal_fps if abs(nominal_fps - fps) < 0.02 * fps else fps, resampled=False)
    regular = np.arange(0, times[-1] + typical / 2, typical)
    return Footage(frames[np.abs(regular[:, None] - times).argmin(axis=1)], 1 / typical, resampled=True)


def refuse_cuts(footage: Footage, name: str) -> None:
    """FacesynthError where one picture has little to do with the one before it."""
    small = footage.frames[:, ::8, ::8].astype(np.float32).mean(axis=3)
    change = np.abs(np.diff(small, axis=0)).mean(axis=(1, 2))
    cuts = np.flatnonzero((change > CUT_LEVEL) & (change > CUT_RATIO * np.median(change)))
    if len(cuts):
        at = (cuts[0] + 1) / footage.fps
        raise FacesynthError(f"{name} has a cut at {at:.2f} s (picture {cuts[0] + 1}); split it there and give the parts")
