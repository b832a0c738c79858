"""How far synthesised points are from recorded ones. `u` is the unit of the layout: mm, px or weight."""

import numpy as np

from facesynth.evaluation.pair import Array, UnavailableError, distances, mean_present, paired_points
from facesynth.evaluation.regions import lip_points
from facesynth.inference.motion import Motion


def marker_error(synthesised: Motion, truth: Motion) -> float:
    """Mean over frames and points of ‖x - y‖ (u)."""
    return mean_present(distances(*paired_points(synthesised, truth)))


def marker_error_centred(synthesised: Motion, truth: Motion) -> float:
    """`marker_error` (u) after each motion's own mean pose over the utterance is taken out.

    What is left when the slow drift of pose, which no sound tells, does not count.
    """
    return mean_present(distances(*_centred(*paired_points(synthesised, truth))))


def deng_error(synthesised: Motion, truth: Motion) -> float:
    """Mean over frames and points of ‖x - y‖² (u²), Deng 2008 eq. 13."""
    return mean_present(distances(*paired_points(synthesised, truth)) ** 2)


def deng_errors(synthesised: Motion, truth: Motion) -> Array:
    """[T] the same of each frame, over the points that the truth has in it; NaN where it has none."""
    squared = distances(*paired_points(synthesised, truth)) ** 2
    seen = ~np.isnan(squared)
    sums = np.where(seen, squared, 0.0).sum(axis=1)
    return np.asarray(np.where(seen.any(axis=1), sums / np.maximum(seen.sum(axis=1), 1), np.nan))


def unit_cube_rms(synthesised: Motion, truth: Motion) -> float:
    """RMS over the coordinates of each frame, mean over frames, of motions scaled into the unit cube (1).

    Cao 2005 §5.2. Both motions are scaled together, by one factor for all axes: the longest side of
    the box that holds every point of both becomes 1. Point layouts only: curves fill no space.
    """
    if truth.layout.kind == "curves":
        raise UnavailableError("curves have no place in space")
    mine, yours = paired_points(synthesised, truth)
    both = np.concatenate([mine, yours]).reshape(-1, mine.shape[2])
    present = both[~np.isnan(both).any(axis=1)]
    side = np.ptp(present, axis=0).max() if len(present) else 0.0
    if not side > 0:
        raise UnavailableError("the points fill no space")
    squared = ((mine - yours) / side) ** 2
    seen = ~np.isnan(squared)
    rows = seen.any(axis=(1, 2))
    per_frame = np.where(seen, squared, 0.0).sum(axis=(1, 2))[rows] / seen.sum(axis=(1, 2))[rows]
    return float(np.sqrt(per_frame).mean())


def lve(synthesised: Motion, truth: Motion) -> float:
    """Lip error: mean over frames of the largest ‖x - y‖ over the lip points (u)."""
    return mean_present(_largest(_lip_distances(*paired_points(synthesised, truth), truth)))


def lve_sq(synthesised: Motion, truth: Motion) -> float:
    """Mean over frames of the largest ‖x - y‖² over the lip points (u²), the form most scripts compute."""
    return mean_present(_largest(_lip_distances(*paired_points(synthesised, truth), truth)) ** 2)


def lve_centred(synthesised: Motion, truth: Motion) -> float:
    """`lve` (u) after each motion's own mean pose over the utterance is taken out."""
    return mean_present(_largest(_lip_distances(*_centred(*paired_points(synthesised, truth)), truth)))


def _lip_distances(mine: Array, yours: Array, truth: Motion) -> Array:
    lips = lip_points(truth.layout)
    return distances(mine[:, lips], yours[:, lips])


def _largest(per_point: Array) -> Array:
    """[T] the largest of [T, K], NaN where a frame has no point."""
    largest = np.where(np.isnan(per_point), -np.inf, per_point).max(axis=1)
    return np.where(np.isneginf(largest), np.nan, largest)


def _centred(mine: Array, yours: Array) -> tuple[Array, Array]:
    """Both motions [T, K, dimension] without their mean over the frames in which the truth has the point."""
    return mine - _mean_pose(mine), yours - _mean_pose(yours)


def _mean_pose(points: Array) -> Array:
    seen = ~np.isnan(points)
    return np.where(seen, points, 0.0).sum(axis=0) / np.maximum(seen.sum(axis=0), 1)
