"""Facial movement: frames of channels at a rate, with the head and the eyes beside them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import FacesynthError
from .layout import Layout


@dataclass(frozen=True, eq=False)
class Motion:
    """T frames of facial motion with head motion removed."""

    frames: NDArray[np.float32]
    """[T, C] in the layout's unit; NaN marks a missing sample."""
    fps: float
    """Frames per second, Hz."""
    layout: Layout
    head: NDArray[np.float32] | None = None
    """[T, 6] rotation vector (rad) and translation (mm) of the head, or None."""
    eyes: NDArray[np.float32] | None = None
    """[T, 3] eye opening 0..1, gaze to the performer's left (rad), gaze up (rad), or None."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "frames", _checked(self.frames, None, self.layout.channels, "frames"))
        if not (np.isfinite(self.fps) and self.fps > 0):
            raise FacesynthError(f"fps must be positive; got {self.fps}")
        for name, width in (("head", 6), ("eyes", 3)):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, _checked(value, len(self.frames), width, name))

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def duration_s(self) -> float:
        """Number of frames over rate, seconds."""
        return len(self.frames) / self.fps

    @property
    def times_s(self) -> NDArray[np.float64]:
        """[T] time of each frame, seconds; frame 0 is at 0."""
        return np.arange(len(self.frames)) / self.fps

    @property
    def points(self) -> NDArray[np.float32]:
        """[T, K, dimension] view of the frames."""
        return self.layout.points(self.frames)


def _checked(value: ArrayLike, length: int | None, width: int, name: str) -> NDArray[np.float32]:
    array = np.asarray(value, np.float32)
    if array.ndim != 2 or array.shape[1] != width or length not in (None, len(array)):
        raise FacesynthError(f"{name} must have shape [{'T' if length is None else length}, {width}]; got {array.shape}")
    return array
