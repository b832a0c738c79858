"""The same movement at another frame rate."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation, RotationSpline

from facesynth.inference.errors import FacesynthError
from facesynth.inference.filters import ORDER, PASS, butterworth, falls, forth_and_back, reach_of
from facesynth.inference.long_arrays import let_go, zeros
from facesynth.inference.motion import Motion
from facesynth.inference.quaternions import one_hemisphere
from facesynth.motion.gaps import missing_in

TOGETHER = 8
"""Points that are brought to another rate at once: those of a long recording together would take ten times its memory."""
SENTENCE_FRAMES = 1000
"""Up to so many frames are filtered without scipy."""


def resample(motion: Motion, fps: float) -> Motion:
    """The same movement at `fps`, with `round(duration * fps)` frames; frame i lies at i / fps in both.

    Cubic splines; movement too fast for a lower rate is filtered out first, without delay. The head turns on a
    rotation spline. Missing samples stay missing: a new sample is NaN where one of the two beside it was.
    """
    if not (np.isfinite(fps) and fps > 0):
        raise FacesynthError(f"fps must be positive; got {fps}")
    if not len(motion):
        raise FacesynthError("a motion without frames has nothing to resample")
    if fps == motion.fps:
        return motion
    change = _Change.between(motion.fps, fps, len(motion))
    frames = _frames(change, motion)
    return Motion(frames, fps, motion.layout, _head(change, motion.head), _eyes(change, motion.eyes))


@dataclass(frozen=True, eq=False)
class _Change:
    """A change of rate of one recording."""

    fps: float
    new_fps: float
    at: NDArray[np.float64]
    """[T'] where the new frames lie, in old frames; those after the last old frame lie on it."""

    @classmethod
    def between(cls, fps: float, new_fps: float, frames: int) -> "_Change":
        count = max(round(frames / fps * new_fps), 1)
        return cls(fps, new_fps, np.minimum(np.arange(count) * fps / new_fps, frames - 1))

    def apply(self, signal: NDArray[np.float64]) -> NDArray[np.float64]:
        """[T, n] without NaN → [T', n]."""
        if len(signal) < 2:
            return np.repeat(signal, len(self.at), axis=0)
        return make_interp_spline(np.arange(len(signal)), self.slowed(signal), k=min(3, len(signal) - 1))(self.at)

    def slowed(self, signal: NDArray[np.float64]) -> NDArray[np.float64]:
        """Without what the new rate cannot carry; nothing is taken out where the rate hardly falls.

        The same filter as `facesynth.inference.filters.at_rate` and, in `apply`, the same spline, by scipy: recordings are long,
        and it takes a ninth of the time for 50 s of 90 markers and less than a hundredth for ten minutes of a head. For a
        sentence importing scipy's filters takes longer than ours.
        """
        if len(signal) < 2 or not falls(self.fps, self.new_fps):
            return signal
        cutoff, reach = PASS * self.new_fps / self.fps, reach_of(len(signal), self.fps, self.new_fps)
        if len(signal) <= SENTENCE_FRAMES:
            return forth_and_back(butterworth(ORDER, cutoff), signal, reach)
        from scipy.signal import butter, sosfiltfilt  # takes 0.3 s to import

        return sosfiltfilt(butter(ORDER, cutoff, output="sos"), signal, axis=0, padlen=reach)

    def touches(self, missing: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """[T, n] which old samples are missing → [T', n] which new ones are."""
        near = 1e-6
        return missing[np.floor(self.at + near).astype(int)] | missing[np.ceil(self.at - near).astype(int)]


def _frames(change: _Change, motion: Motion) -> NDArray[np.float32]:
    """[T, C] → [T', C], some points at a time."""
    out = zeros((len(change.at), motion.layout.channels), np.float32)
    each = motion.layout.dimension * TOGETHER
    for first in range(0, motion.layout.channels, each):
        some = np.ascontiguousarray(motion.frames[:, first : first + each])
        new = _points(change, some, motion.layout.dimension)
        out[:, first : first + each] = _within(new, some) if motion.layout.kind == "curves" else new
        let_go(motion.frames)
        let_go(out)
    return out


def _points(change: _Change, frames: NDArray[np.float32], dimension: int) -> NDArray[np.float32]:
    """[T, K * dimension] → [T', K * dimension]; gaps are bridged for the splines and opened again."""
    points = frames.reshape(len(frames), -1, dimension)
    missing = missing_in(points)
    bridged = points.astype(np.float64)
    for k in np.flatnonzero(missing.any(axis=0)):
        bridged[:, k] = _bridged(bridged[:, k], missing[:, k])
    new = change.apply(bridged.reshape(len(frames), -1)).reshape(len(change.at), -1, dimension)
    new[change.touches(missing)] = np.nan
    return new.reshape(len(change.at), -1).astype(np.float32)


def _head(change: _Change, head: NDArray[np.float32] | None) -> NDArray[np.float32] | None:
    if head is None:
        return None
    missing = missing_in(head)
    shift = _points(change, head[:, 3:], 3)
    if missing.all():
        return np.full((len(change.at), 6), np.nan, np.float32)
    turn = _turns(change, head[:, :3].astype(np.float64), missing)
    turn[change.touches(missing)] = np.nan
    return np.concatenate([turn, shift], axis=1).astype(np.float32)


def _turns(change: _Change, rotvecs: NDArray[np.float64], missing: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Rotation vectors [T, 3] → [T', 3] through quaternions of one hemisphere."""
    present = ~missing
    quaternions = np.zeros((len(rotvecs), 4))
    quaternions[present] = Rotation.from_rotvec(rotvecs[present]).as_quat()
    quaternions[present] = one_hemisphere(quaternions[present])
    whole = Rotation.from_quat(change.slowed(_bridged(quaternions, missing)))
    if len(whole) < 2:
        return np.repeat(whole.as_rotvec(), len(change.at), axis=0)
    return RotationSpline(np.arange(len(whole)), whole)(change.at).as_rotvec()


def _eyes(change: _Change, eyes: NDArray[np.float32] | None) -> NDArray[np.float32] | None:
    if eyes is None:
        return None
    new = _points(change, eyes, 1)
    new[:, 0] = np.clip(new[:, 0], 0.0, 1.0)
    return new


def _bridged(track: NDArray[np.float64], missing: NDArray[np.bool_]) -> NDArray[np.float64]:
    """A track [T, n] with straight lines over its gaps, and zeros where nothing is present at all."""
    known = np.flatnonzero(~missing)
    if not len(known):
        return np.zeros_like(track)
    index = np.arange(len(track))
    return np.stack([np.interp(index, known, channel) for channel in track[known].T], axis=1)


def _within(frames: NDArray[np.float32], original: NDArray[np.float32]) -> NDArray[np.float32]:
    """Curves kept inside the range that each had: a spline must not make a weight negative."""
    empty = np.isnan(original).all(axis=0)
    low, high = (bound(np.where(empty, 0.0, original), axis=0) for bound in (np.nanmin, np.nanmax))
    return np.clip(frames, low, high).astype(np.float32)
