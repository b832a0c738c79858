"""Followed points to shapes: gaps filled, the head's motion taken out."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facesynth.capture.points.tracking import Points, neighbours_mean
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.motion.gaps import fill_gaps
from facesynth.motion.planar import HeadMaps, motion_frames

ROBUST_ROUNDS = 5
FEWEST_STILL = 6
"""Points on the upper face that are enough to tell the head's motion."""

STRAYED_SPREADS = 8.0
STRAYED_SHARE = 0.035
"""Of the face's height or width, whichever is larger."""
NEIGHBOURS = 6


@dataclass(frozen=True, eq=False)
class Shapes:
    """The lower face of one clip."""

    points: NDArray[np.float64]
    """[T, K, 2] px, y down, head-fixed: as if the head stood as in the reference picture."""
    head: HeadMaps
    """Where the head really was."""
    fps: float

    def joined(self, others: Points) -> "Shapes":
        """With other points [T, L, 2] px of the same pictures behind them, on the same head."""
        return Shapes(np.concatenate([self.points, self.head.to_head(others.astype(np.float64))], axis=1), self.head, self.fps)

    def to_motion(self, layout: Layout) -> Motion:
        """As motion of landmarks; a layout's y points up."""
        return Motion(motion_frames(self.points), self.fps, layout)


def mean_shape(reference: Points, lower: int, clips: list[Points], fps: float) -> NDArray[np.float64]:
    """[K + J, 2] mean over clips [T, K + J, 2] of the head-fixed points, of which the first `lower` are the lower face."""
    return np.mean([_steadied(reference, lower, clip, fps)[1].mean(axis=0) for clip in clips], axis=0)


def shapes_of(reference: Points, lower: int, everywhere: NDArray[np.float64], clip: Points, fps: float) -> Shapes:
    """The shapes of one clip [T, K + J, 2].

    Frame by frame a similarity takes the head's motion out, told by the upper face where there are points on it. How the
    head was held differs from clip to clip, and foreshortens the face: an affine map for each clip brings its mean
    shape to that of all clips, `everywhere` [K + J, 2].
    """
    head, fixed = _steadied(reference, lower, clip, fps)
    held = _held(head, everywhere, fixed.mean(axis=0))
    return Shapes(held.to_head(head.to_picture(fixed[:, :lower])), held, fps)


def _steadied(reference: Points, lower: int, clip: Points, fps: float) -> tuple[HeadMaps, NDArray[np.float64]]:
    """Where the head was, and head-fixed points [T, K + J, 2] without gaps."""
    start = reference.astype(np.float64)
    still = slice(lower, None) if len(reference) - lower >= FEWEST_STILL else slice(None)
    whole = _filled(reference, clip, fps)
    head = _similarities(start[still], whole[:, still])
    strayed = outliers(start, head.to_head(whole))
    if strayed.any():
        whole = _filled(reference, np.where(strayed[:, :, None], np.nan, clip).astype(np.float32), fps)
        head = _similarities(start[still], whole[:, still])
    return head, head.to_head(whole)


def outliers(reference: NDArray[np.float64], fixed: NDArray[np.float64]) -> NDArray[np.bool_]:
    """[T, P] samples of head-fixed points [T, P, 2] that jumped onto something else.

    They lie further from the point's own median place than it ever spreads, and do not move as the points around do.
    """
    from scipy.spatial import cKDTree

    moved = fixed - reference
    own = np.linalg.norm(moved - np.median(moved, axis=0), axis=2)
    spread = np.maximum(np.median(own, axis=0), 0.5)
    around = cKDTree(reference).query(reference, k=np.arange(2, min(NEIGHBOURS + 2, len(reference) + 1)))[1]
    apart = np.linalg.norm(moved - np.median(moved[:, around], axis=2), axis=2)
    return np.asarray((own > STRAYED_SPREADS * spread) & (apart > STRAYED_SHARE * np.ptp(reference, axis=0).max()))


def _filled(reference: Points, clip: Points, fps: float) -> NDArray[np.float64]:
    """Points [T, K + J, 2] of a clip without gaps: short ones filled in time, long ones from the neighbours."""
    short = fill_gaps(clip.reshape(len(clip), -1), fps, 2)[0].reshape(clip.shape)
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
