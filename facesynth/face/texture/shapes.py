"""Tracks to shapes: gaps filled, the head's motion taken out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facesynth.face.texture.tracking import Tracks, neighbours_mean
from facesynth.motion.gaps import fill_gaps
from facesynth.motion.layout import Layout
from facesynth.motion.motion import Motion

ROBUST_ROUNDS = 5
FEWEST_STILL = 6
"""Points on the upper face that are enough to tell the head's motion."""


@dataclass(frozen=True, eq=False)
class HeadMaps:
    """For each frame the map p -> p @ linear + shift from head-fixed to picture coordinates (rows are points)."""

    linear: NDArray[np.float64]
    """[T, 2, 2]"""
    shift: NDArray[np.float64]
    """[T, 2] px."""

    def to_picture(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points [T, K, 2] px."""
        return points @ self.linear + self.shift[:, None]

    def to_head(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """The inverse of `to_picture`."""
        return (points - self.shift[:, None]) @ np.linalg.inv(self.linear)


@dataclass(frozen=True, eq=False)
class Shapes:
    """The lower face of one clip."""

    points: NDArray[np.float64]
    """[T, K, 2] px, y down, head-fixed: as if the head stood as in the reference picture."""
    head: HeadMaps
    """Where the head really was."""
    fps: float

    def to_motion(self) -> Motion:
        """As motion of landmarks; a layout's y points up."""
        count = self.points.shape[1]
        layout = landmark_layout(count)
        return Motion((self.points * [1, -1]).reshape(len(self.points), -1).astype(np.float32), self.fps, layout)


def landmark_layout(count: int) -> Layout:
    """Tracked points have no names of their own: p000, p001, …; all of them move with the mouth."""
    return Layout("landmarks", tuple(f"p{i:03d}" for i in range(count)), {"mouth": tuple(range(count))})


def picture_points(frames: NDArray[np.float32]) -> NDArray[np.float64]:
    """Frames [T, 2 K] of such a motion to points [T, K, 2] px, y down."""
    return frames.reshape(len(frames), -1, 2).astype(np.float64) * [1, -1]


def shapes_of(tracks: Tracks, fps: float) -> list[Shapes]:
    """The shapes of every clip.

    Frame by frame a similarity takes the head's motion out, told by the upper face where there are points on it. How the
    head was held differs from clip to clip, and foreshortens the face: an affine map for each clip brings its mean
    shape to that of all clips.
    """
    reference = tracks.reference.astype(np.float64)
    wholes = [_filled(tracks, clip, fps) for clip in tracks.clips]
    still = slice(tracks.lower, None) if len(reference) - tracks.lower >= FEWEST_STILL else slice(None)
    heads = [_similarities(reference[still], whole[:, still]) for whole in wholes]
    means = [head.to_head(whole).mean(axis=0) for head, whole in zip(heads, wholes, strict=True)]
    held = [_held(head, np.mean(means, axis=0), mean) for head, mean in zip(heads, means, strict=True)]
    return [Shapes(head.to_head(whole[:, : tracks.lower]), head, fps) for head, whole in zip(held, wholes, strict=True)]


def _filled(tracks: Tracks, clip: NDArray[np.float32], fps: float) -> NDArray[np.float64]:
    """Points [T, K + J, 2] of a clip without gaps: short ones filled in time, long ones from the neighbours."""
    short = fill_gaps(clip.reshape(len(clip), -1), fps, 2)[0].reshape(clip.shape)
    reference = tracks.reference
    return np.stack([reference + neighbours_mean(reference, frame - reference) for frame in short]).astype(np.float64)


def _held(head: HeadMaps, everywhere: NDArray[np.float64], here: NDArray[np.float64]) -> HeadMaps:
    """Head maps of a clip after the affine map from the mean shape of all clips [P, 2] to the clip's own."""
    affine = np.linalg.lstsq(np.column_stack([everywhere, np.ones(len(everywhere))]), here, rcond=None)[0]
    return HeadMaps(affine[:2] @ head.linear, (affine[2] @ head.linear) + head.shift)


def _similarities(reference: NDArray[np.float64], frames: NDArray[np.float64]) -> HeadMaps:
    """Least-squares similarity from reference [J, 2] to each frame [T, J, 2], points far off weighing less each round."""
    # As complex numbers, a similarity is z -> a z + b.
    z, w = reference @ [1, 1j], frames @ [1, 1j]
    weight = np.ones(w.shape)
    for _ in range(ROBUST_ROUNDS):
        total = weight.sum(axis=1, keepdims=True)
        z0, w0 = (weight * z).sum(axis=1, keepdims=True) / total, (weight * w).sum(axis=1, keepdims=True) / total
        a = (weight * np.conj(z - z0) * (w - w0)).sum(axis=1, keepdims=True) / (weight * np.abs(z - z0) ** 2).sum(
            axis=1, keepdims=True
        )
        b = w0 - a * z0
        distance = np.abs(w - a * z - b)
        weight = 1 / np.maximum(distance, 0.3 + np.median(distance, axis=1, keepdims=True))
    real, imaginary = a[:, 0].real, a[:, 0].imag
    linear = np.stack([np.stack([real, imaginary], axis=-1), np.stack([-imaginary, real], axis=-1)], axis=-2)
    return HeadMaps(linear, np.stack([b[:, 0].real, b[:, 0].imag], axis=-1))
