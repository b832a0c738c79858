"""What a face does over time: weights of its shapes, the head, the gaze and the tongue, at one rate."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from facesynth.inference.errors import FacesynthError
from facesynth.inference.long_arrays import Growing, all_finite, row_blocks

SEEN = 2
"""Frames before and after two neighbours that the monotone cubic between them depends on, with one to spare."""


@dataclass(frozen=True, eq=False)
class FaceAnimation:
    """T frames of a head with ARKit's shapes or with channels of its own; all arrays are kept as float32."""

    names: tuple[str, ...]
    """N shapes or channels; the columns of `weights`."""
    weights: NDArray[Any]
    """[T, N], each in its range."""
    head: NDArray[Any]
    """[T, 6] rotation vector (rad) and translation (mm) of the head about the rig's pivot."""
    gaze: NDArray[Any]
    """[T, 2] direction of both eyes in the head: to the performer's left, up (rad)."""
    tongue_up: NDArray[Any]
    """[T] 0..1, how far the tip of the tongue is lifted; no ARKit shape does that."""
    fps: float
    """Frames per second, Hz."""
    residual_mm: NDArray[Any] | None = None
    """[T] root mean square distance of the solved markers from the asked ones, where weights were solved."""
    ranges: NDArray[Any] | None = None
    """[N, 2] lowest and highest weight of channels that have limits of their own; 0..1 without."""
    sources: Mapping[str, str] = field(default_factory=dict)
    """Who moves each part of the face: mouth, head, eyes; empty where that is not known."""

    def __post_init__(self) -> None:
        count = len(np.asarray(self.weights))
        shapes = {"weights": (count, len(self.names)), "head": (count, 6), "gaze": (count, 2), "tongue_up": (count,)}
        if self.residual_mm is not None:
            shapes["residual_mm"] = (count,)
        for name, shape in shapes.items():
            object.__setattr__(self, name, _checked(getattr(self, name), shape, name))
        if not count or not (np.isfinite(self.fps) and self.fps > 0):
            raise FacesynthError(
                f"an animation needs at least one frame and a positive fps; got {count} frames at {self.fps} fps"
            )
        if self.ranges is not None:
            object.__setattr__(self, "ranges", _checked(self.ranges, (len(self.names), 2), "ranges"))
        low, high = self.limits
        if any(((some < low) | (some > high)).any() for some in map(self.weights.__getitem__, row_blocks(self.weights))):
            wanted = "0..1" if self.ranges is None else "the ranges of their channels"
            raise FacesynthError(
                f"weights must lie in {wanted}; got {self.weights.min():.3f}..{self.weights.max():.3f}; clip them before"
            )

    def __len__(self) -> int:
        return len(self.weights)

    @property
    def limits(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Lowest and highest weight [N] of each channel."""
        if self.ranges is None:
            return np.zeros(len(self.names), np.float32), np.ones(len(self.names), np.float32)
        return self.ranges[:, 0], self.ranges[:, 1]

    @property
    def duration_s(self) -> float:
        """Number of frames over rate, seconds."""
        return len(self) / self.fps

    @property
    def times_s(self) -> NDArray[np.float64]:
        """[T] time of each frame, seconds; frame 0 is at 0."""
        return np.arange(len(self)) / self.fps

    def weight(self, name: str) -> NDArray[np.float32]:
        """[T] one shape's weights; zeros for a shape that this animation does not have."""
        return self.weights[:, self.names.index(name)] if name in self.names else np.zeros(len(self), np.float32)

    def weights_for(self, names: tuple[str, ...], rows: slice = slice(None)) -> NDArray[np.float32]:
        """[T, len(names)] weights in another rig's order of shapes, of some frames where they are named."""
        return np.stack([self.weight(name)[rows] for name in names], axis=1)

    def resampled(self, fps: float) -> "FaceAnimation":
        """The same movement at another rate; 23.976 and 29.97 are fine.

        Monotone cubic interpolation, which never leaves the range of its neighbours, so that weights
        stay in their ranges and a shut eye stays shut; the head turns on the shortest arc.
        """
        from scipy.spatial.transform import Rotation, Slerp

        if not (np.isfinite(fps) and fps > 0):
            raise FacesynthError(f"fps must be positive; got {fps}")
        if fps == self.fps or len(self) == 1:
            return self if fps == self.fps else self._stretched(fps)
        count = max(1, round(self.duration_s * fps))
        at = np.minimum(np.arange(count) / fps, self.times_s[-1])

        def turned(times_s: NDArray[Any], turns: NDArray[Any], at_s: NDArray[Any]) -> NDArray[Any]:
            return np.asarray(Slerp(times_s, Rotation.from_rotvec(turns))(at_s).as_rotvec())

        rotation = _read(turned, self.times_s, self.head[:, :3], at, np.float64)

        def curve(values: NDArray[Any], low: ArrayLike = -np.inf, high: ArrayLike = np.inf) -> NDArray[np.float32]:
            return monotone_cubic(self.times_s, values, at, low, high)

        return replace(
            self,
            weights=curve(self.weights, *self.limits),
            head=np.concatenate([rotation, curve(self.head[:, 3:])], axis=1),
            gaze=curve(self.gaze),
            tongue_up=curve(self.tongue_up),
            fps=fps,
            residual_mm=None if self.residual_mm is None else curve(self.residual_mm),
        )

    def _stretched(self, fps: float) -> "FaceAnimation":
        """One frame, held."""
        many = np.zeros(max(1, round(self.duration_s * fps)), np.int64)
        residual = None if self.residual_mm is None else self.residual_mm[many]
        tracks = {name: getattr(self, name)[many] for name in ("weights", "head", "gaze", "tongue_up")}
        return replace(self, fps=fps, residual_mm=residual, **tracks)


# The cubic of an interval depends on the values at its ends and the slopes there, and a slope on its own value and on those
# of its two neighbours (Fritsch & Butland 1984; at the ends of the whole, on the first and last three). A piece with that
# much around it therefore gives the same numbers as the whole, whose four coefficients an interval need not be there at once.
def monotone_cubic(
    times_s: NDArray[Any], values: NDArray[Any], at_s: NDArray[Any], low: ArrayLike, high: ArrayLike
) -> NDArray[np.float32]:
    """[n, ...] values [T, ...] of ascending times [T] read at ascending times [n] within them, kept in low..high; T > 1."""
    from scipy.interpolate import PchipInterpolator

    def read(times_s: NDArray[Any], some: NDArray[Any], at_s: NDArray[Any]) -> NDArray[Any]:
        return np.clip(PchipInterpolator(times_s, some, axis=0)(at_s), low, high)

    return _read(read, times_s, values, at_s, np.float32)


def _read(
    read: Callable[[NDArray[Any], NDArray[Any], NDArray[Any]], NDArray[Any]],
    times_s: NDArray[Any],
    values: NDArray[Any],
    at_s: NDArray[Any],
    dtype: DTypeLike,
) -> NDArray[Any]:
    """What `read` makes of times, values and the times at which they are read, some values and those around them at a time."""
    parts = Growing(dtype)
    for rows in row_blocks(values):
        around = slice(max(0, rows.start - SEEN), rows.stop + 1 + SEEN)
        first = np.searchsorted(at_s, times_s[rows.start])
        stop = np.searchsorted(at_s, times_s[rows.stop]) if rows.stop < len(times_s) else len(at_s)
        parts.add(read(times_s[around], values[around], at_s[first:stop]) if first < stop else values[:0])
    return parts.whole()


def _checked(value: ArrayLike, shape: tuple[int, ...], name: str) -> NDArray[np.float32]:
    array = np.asarray(value, np.float32)
    if array.shape != shape:
        raise FacesynthError(f"{name} of an animation must have shape {list(shape)}; got {list(array.shape)}")
    if not all_finite(array):
        raise FacesynthError(f"{name} of an animation holds NaN or infinite values; fill the gaps first")
    return array
