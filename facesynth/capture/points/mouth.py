"""The lips and the chin, found by the face mesh: skin has corners that can be followed, the red of the lips has none.

Corners inside the lips would be followed from teeth to lip and back; they are not looked for where these points are.
"""

from itertools import chain

import numpy as np
from numpy.typing import NDArray

from facesynth.capture.landmarks import LOWER_INNER, LOWER_OUTER, UPPER_INNER, UPPER_OUTER
from facesynth.capture.tracker import Tracker
from facesynth.inference.errors import FacesynthError
from facesynth.motion.gaps import fill_gaps
from facesynth.motion.planar import MOUTH_ROWS

CHIN = (200, 199, 175, 152, 148, 377, 176, 400)
_ROWS = {
    "upper_outer": UPPER_OUTER,
    "lower_outer": LOWER_OUTER,
    "upper_inner": UPPER_INNER,
    "lower_inner": LOWER_INNER,
    "chin": CHIN,
}
LANDMARKS = tuple(chain.from_iterable(_ROWS[row] for row in MOUTH_ROWS))
"""L landmarks of the face mesh in the order in which a layout of followed points names them."""
SEEN_SHARE = 0.6
"""A clip in which the mesh is found in a smaller share of the pictures is refused."""
CLEARANCE = 0.12
"""Corners stay so far from the outer lips, in widths of the mouth; the mouth opens downwards by as much again."""


def follow_mouth(frames: NDArray[np.uint8], fps: float, face: int | None = None) -> NDArray[np.float32]:
    """[T, L, 2] px of the lips and the chin in pictures [T, H, W, 3]; filled in where the mesh is lost."""
    tracker = Tracker(face)
    paths = np.full((len(frames), len(LANDMARKS), 2), np.nan, np.float32)
    for t, picture in enumerate(frames):
        seen = tracker.follow(picture)
        if seen is not None:
            paths[t] = seen.points[list(LANDMARKS), :2]
    shown = np.isfinite(paths[:, 0, 0])
    if shown.mean() < SEEN_SHARE:
        raise FacesynthError(
            f"the lips are found in {shown.mean():.0%} of its pictures, at least {SEEN_SHARE:.0%} are needed; is it hidden?"
        )
    filled = fill_gaps(paths.reshape(len(paths), -1), fps, 2)[0]
    known = np.flatnonzero(shown)
    nearest = known[np.abs(np.arange(len(paths))[:, None] - known).argmin(axis=1)]
    return np.where(np.isfinite(filled), filled, filled[nearest]).reshape(paths.shape).astype(np.float32)


def mouth_mask(mouth: NDArray[np.floating], height: int, width: int) -> NDArray[np.bool_]:
    """[H, W] where a mouth [L, 2] px and what its lips move over lie: an ellipse around the outer lips, lower than they are."""
    outer = mouth[: len(UPPER_OUTER) + len(LOWER_OUTER)]
    left, top = outer.min(axis=0)
    right, bottom = outer.max(axis=0)
    clearance = CLEARANCE * (right - left)
    y, x = np.mgrid[:height, :width]
    bottom += clearance
    across = (x - (left + right) / 2) / ((right - left) / 2 + clearance)
    down = (y - (top + bottom) / 2) / ((bottom - top) / 2 + clearance)
    return np.asarray(across**2 + down**2 <= 1)
