"""A recording as another system keeps it: motion, and whatever else lies in the same file."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.long_arrays import by_blocks, row_blocks
from facesynth.inference.motion import Motion
from facesynth.inference.npz import LARGEST_BYTES
from facesynth.inference.speech import PhoneTrack
from facesynth.motion.gaps import filled_in
from facesynth.motion.placeholders import placeholders
from facesynth.speech.segments import Segment

SLOWEST_HZ, FASTEST_HZ = 1.0, 10000.0
"""Rates at which faces are recorded lie between."""


@dataclass(frozen=True, eq=False)
class Sound:
    """Sound that lies in the file of the motion."""

    audio: NDArray[np.float32]
    """[S] mono, -1..1."""
    sample_rate: int
    """Hz."""


@dataclass(frozen=True, eq=False)
class Reading:
    """What was read of one recording."""

    motion: Motion
    """In the file's own layout and at its own rate."""
    sound: Sound | None = None
    phones: PhoneTrack | None = None
    words: tuple[Segment, ...] = ()
    text: str = ""
    remarks: tuple[str, ...] = field(default=())
    silent: bool = False
    """Whether it is of use without sound: it shows eyes and blinks."""


def require_file(path: Path) -> None:
    """FacesynthError for a file that is missing, empty or too large to be one recording."""
    if not path.is_file():
        raise FacesynthError(f"{path}: no such file")
    size = path.stat().st_size
    if not 0 < size <= LARGEST_BYTES:
        what = "is empty (0 bytes)" if not size else f"is larger than {LARGEST_BYTES / 1e9:.1f} GB"
        raise FacesynthError(f"{path} {what}; export the recording again")


def motion_of_arrays(
    path: Path,
    frames: NDArray[np.floating],
    fps: float,
    layout: Layout,
    head: NDArray[np.floating] | None = None,
    eyes: NDArray[np.floating] | None = None,
) -> Motion:
    """A motion of what was read; what does not fit becomes an error that names the file."""
    try:
        motion = Motion(np.asarray(frames, np.float32), float(fps), layout, _single(head), _single(eyes))
    except (ValueError, TypeError) as error:
        raise FacesynthError(f"{path}: {error}") from None
    if not SLOWEST_HZ <= motion.fps <= FASTEST_HZ:
        raise FacesynthError(f"{path} states {motion.fps:g} frames a second; wanted {SLOWEST_HZ:g} to {FASTEST_HZ:g}; give --fps")
    unusable = [
        (np.isinf(some).any(), np.isnan(some).all()) for some in (motion.frames[rows] for rows in row_blocks(motion.frames))
    ]
    if not unusable or any(infinite for infinite, _ in unusable) or all(missing for _, missing in unusable):
        raise FacesynthError(f"{path} holds no frames, only missing samples, or infinite values; export it again")
    return motion


def _single(signal: NDArray[np.floating] | None) -> NDArray[np.float32] | None:
    return None if signal is None else np.asarray(signal, np.float32)


def open_gaps(points: NDArray[np.floating]) -> tuple[NDArray[np.floating], tuple[str, ...]]:
    """Points [T, K, 3 or 2] with NaN where programs wrote a number for a gap, and what is said of it."""
    far = filled_in(points)
    near = placeholders(points, far)
    far &= ~by_blocks(lambda some: np.asarray(np.isnan(some).any(axis=2)), points, bool)
    ways = (
        (far, "are {zeros} or far from the face, as programs write gaps"),
        (near, "stand exactly still outside of the face while others move, as numbers that programs write for gaps"),
    )
    zeros = ", ".join("0" * points.shape[2])
    said = tuple(
        f"{np.count_nonzero(mask)} samples {what.format(zeros=zeros)}: they are gaps" for mask, what in ways if mask.any()
    )
    return (np.where((far | near)[..., None], np.nan, points), said) if said else (points, ())
