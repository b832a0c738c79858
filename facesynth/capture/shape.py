"""From points in a picture to the shape of a face: its size, its rest, and its movement without the head's.

A camera far from a face sees it nearly in parallel rays: picture and face differ by a rotation, a shift and one
factor (weak perspective), and the mesh gives depth on the picture's own scale.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from facesynth.capture.landmarks import LIP_PAIRS, OUTER_CORNERS, OUTER_CORNERS_MM, RIGID
from facesynth.capture.track import Track
from facesynth.inference.arrays import Floats
from facesynth.inference.errors import FacesynthError
from facesynth.motion.pose import remove_head

SCALE_S = 0.5
"""Deviation of the Gaussian that evens the scale out: a head comes nearer slowly, what is quicker is noise."""
ROUNDS = 3
REST_SHARE = 0.3
"""The face is at rest in that share of the frames in which the lips are nearest to each other."""
FOREHEAD, CHIN = 10, 152


def neutral_shape(tracks: Sequence[Track]) -> Floats:
    """[468, 3] mm: the performer's face at rest, from what was seen in some clips.

    All frames are laid on one another (generalised Procrustes analysis on the rigid points); the rest is the median of those
    in which the mouth is most nearly shut. It faces along z, its outer eye corners are `OUTER_CORNERS_MM` apart.
    """
    frames = [in_axes(track.points_px[track.present]) for track in tracks if track.present.any()]
    if not frames:
        raise FacesynthError("no clip shows a face, so its rest cannot be found; check the recordings")
    shapes = np.concatenate(frames)
    mean = _facing(shapes[0])
    for _ in range(ROUNDS):
        aligned = _stabilised(shapes * scales(shapes, mean)[:, None, None], mean)
        mean = _facing(np.median(aligned, axis=0))
    gap = np.mean([aligned[:, upper, 1] - aligned[:, lower, 1] for upper, lower in LIP_PAIRS], axis=0)
    return _facing(np.median(aligned[gap <= np.quantile(gap, REST_SHARE)], axis=0))


def in_axes(points_px: NDArray[np.floating]) -> Floats:
    """Points [..., 3] of a picture in the axes of a face: x to the performer's left, y up, z out of the face."""
    return np.asarray(points_px, np.float64) * [1.0, -1.0, -1.0]


def in_mm(track: Track, neutral_mm: Floats) -> Floats:
    """[T, 468, 3] the points of a video in mm around the middle of where the head mostly is; NaN where no face is seen.

    The scale is that which gives the rigid points the size that they have in the neutral face [468, 3].
    """
    shapes = in_axes(track.points_px)
    present = track.present
    scale = np.full(len(shapes), np.nan)
    scale[present] = _even(scales(shapes[present], neutral_mm), SCALE_S * track.fps)
    world = shapes * scale[:, None, None]
    middle = world[present][:, list(RIGID)].mean(axis=1)
    return world - np.median(middle, axis=0) + neutral_mm[list(RIGID)].mean(axis=0)


def scales(shapes: Floats, neutral_mm: Floats) -> Floats:
    """[T] factor that gives the rigid points of shapes [T, 468, 3] the size of the neutral's (root mean square radius)."""
    return _radius(neutral_mm[None]) / _radius(shapes)


def _radius(shapes: Floats) -> Floats:
    rigid = shapes[:, list(RIGID)]
    return np.sqrt(((rigid - rigid.mean(axis=1, keepdims=True)) ** 2).sum(axis=(1, 2)))


def _even(scale: Floats, deviation_frames: float) -> Floats:
    return gaussian_filter1d(scale, deviation_frames, mode="nearest")


def _stabilised(shapes: Floats, mean: Floats) -> Floats:
    return remove_head(shapes, mean, RIGID)[0].astype(np.float64)


def _facing(shape: Floats) -> Floats:
    """A shape [468, 3] turned so that the outer eye corners lie along x and forehead and chin along y, in mm."""
    across = shape[OUTER_CORNERS[1]] - shape[OUTER_CORNERS[0]]
    x = across / np.linalg.norm(across)
    up = shape[FOREHEAD] - shape[CHIN]
    y = up - (up @ x) * x
    y /= np.linalg.norm(y)
    turn = np.stack([x, y, np.cross(x, y)])
    placed = (shape - shape[list(RIGID)].mean(axis=0)) @ turn.T
    return placed * (OUTER_CORNERS_MM / np.linalg.norm(across))
