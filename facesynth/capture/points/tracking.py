"""Salient points of a picture, followed through clips of one speaker.

Shi-Tomasi corners of the reference picture, Lucas-Kanade from picture to picture, and two safeguards. Each
step is tracked back again, and a point that does not return is lost. And each position is refined against the
reference picture itself, where that still looks alike: errors of the steps do not add up to drift.

Both are OpenCV's: kornia has no Lucas-Kanade, and its measure of corners (`gftt_response`) knows no mask and no distance
between corners, and takes seven times as long.
"""

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.errors import FacesynthError

Grey = NDArray[np.uint8]
Points = NDArray[np.float32]

WINDOW_PX = 15
RETURN_PX = 1.0
"""A point that comes back further from where it was is lost."""
REFINED_PX = 2.0
"""Refinement against the reference moves a point by no more than this."""


@dataclass(frozen=True)
class Drift:
    """How far points are, in px, when a clip was followed to its end and back again."""

    median_px: float
    worst_tenth_px: float
    """90th percentile."""
    lost_share: float
    """Share of points that did not survive the way."""


def corners(picture: Grey, mask: NDArray[np.bool_], count: int) -> Points:
    """Up to `count` Shi-Tomasi corners [K, 2] px, strongest first, spread over the mask [H, W]."""
    apart = 0.7 * float(np.sqrt(mask.sum() / max(count, 1)))
    found = _cv2().goodFeaturesToTrack(picture, count, 0.005, max(apart, 2.0), mask=mask.astype(np.uint8), blockSize=5)
    return np.zeros((0, 2), np.float32) if found is None else found.reshape(-1, 2).astype(np.float32)


def drift(clip: Grey, start: Points) -> Drift:
    """Follow points [K, 2] through a clip [T, H, W] step by step and back, without the reference's help."""
    there = np.concatenate([clip, clip[-2::-1]])
    points = start
    for before, after in itertools.pairwise(there):
        points = _step(before, after, points)
    distance = np.linalg.norm(points - start, axis=1)
    alive = np.isfinite(distance)
    if not alive.any():
        return Drift(np.inf, np.inf, 1.0)
    return Drift(float(np.median(distance[alive])), float(np.quantile(distance[alive], 0.9)), float(1 - alive.mean()))


def follow_clip(clip: Grey, reference: Grey, start: Points) -> Points:
    """[T, K, 2] points, at `start` [K, 2] in the reference picture [H, W], in every picture of a clip [T, H, W]; NaN where lost.

    The clip is entered at the picture that is most like the reference and followed both ways from there.
    """
    small = clip[:, ::4, ::4].astype(np.float32)
    likeness = np.abs(small - reference[::4, ::4].astype(np.float32)).mean(axis=(1, 2))
    entry = int(likeness.argmin())
    first = _refined(reference, clip[entry], start, _step(reference, clip[entry], start))
    forwards = _follow(clip[entry:], reference, start, first)
    backwards = _follow(clip[entry::-1], reference, start, first)
    return np.concatenate([backwards[:0:-1], forwards])


def _follow(clip: Grey, reference: Grey, start: Points, first: Points) -> Points:
    """[T, K, 2] from positions `first` in the clip's first picture.

    A lost point is looked for again where its neighbours say that it should be; if the reference confirms it, it is back.
    """
    paths = [first]
    for before, after in itertools.pairwise(clip):
        stepped = _step(before, after, paths[-1])
        paths.append(_refined(reference, after, start, stepped))
    return np.stack(paths)


def _step(before: Grey, after: Grey, points: Points) -> Points:
    """Positions [K, 2] in the next picture; NaN for a point that does not come back or was lost before."""
    return _confirmed(before, after, points, None)


def _refined(reference: Grey, picture: Grey, start: Points, points: Points) -> Points:
    """Positions corrected by matching the reference picture itself; NaN ones are looked for near their neighbours."""
    known = np.isfinite(points[:, 0])
    if known.sum() < 3:
        return points
    guess = np.where(known[:, None], points, start + neighbours_mean(start, points - start))
    matched = _confirmed(reference, picture, start, guess)
    close = np.linalg.norm(matched - guess, axis=1) <= REFINED_PX
    return np.where(close[:, None], matched, points).astype(np.float32)


def _confirmed(before: Grey, after: Grey, points: Points, guess: Points | None) -> Points:
    there = _lucas_kanade(before, after, np.nan_to_num(points), None if guess is None else np.nan_to_num(guess))
    back = _lucas_kanade(after, before, there, None if guess is None else np.nan_to_num(points))
    height, width = after.shape
    inside = (there >= 0).all(axis=1) & (there[:, 0] <= width - 1) & (there[:, 1] <= height - 1)
    good = inside & (np.linalg.norm(back - points, axis=1) <= RETURN_PX)
    return np.where(good[:, None], there, np.nan).astype(np.float32)


def _lucas_kanade(before: Grey, after: Grey, points: Points, guess: Points | None) -> Points:
    cv2 = _cv2()
    flags = 0 if guess is None else cv2.OPTFLOW_USE_INITIAL_FLOW
    first = np.ascontiguousarray(points, np.float32).reshape(-1, 1, 2)
    second = None if guess is None else np.ascontiguousarray(guess, np.float32).reshape(-1, 1, 2).copy()
    found, status, _ = cv2.calcOpticalFlowPyrLK(
        before, after, first, second, winSize=(WINDOW_PX, WINDOW_PX), maxLevel=3, flags=flags
    )
    return np.where(status.astype(bool), found.reshape(-1, 2), np.float32(-1e6))


def neighbours_mean(reference: Points, displacement: Points, neighbours: int = 6) -> Points:
    """Displacements [K, 2] with NaN filled by the mean of the nearest known ones, weighted by 1 / distance on the reference."""
    from scipy.spatial import cKDTree

    known = np.isfinite(displacement[:, 0])
    if known.all() or not known.any():
        return displacement
    count = min(neighbours, int(known.sum()))
    distance, index = cKDTree(reference[known]).query(reference[~known], k=np.arange(1, count + 1))
    weight = 1 / np.maximum(distance, 1e-3)
    filled = displacement.copy()
    filled[~known] = (displacement[known][index] * weight[:, :, None]).sum(axis=1) / weight.sum(axis=1, keepdims=True)
    return filled


def _cv2() -> Any:
    try:
        import cv2
    except ImportError:
        raise FacesynthError("following points in video needs OpenCV; install it with `pip install 'facesynth[video]'`") from None
    return cv2
