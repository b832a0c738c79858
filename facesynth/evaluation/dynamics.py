"""How much and how smoothly a synthesised face moves, beside how far it is off. `u`: mm, px or weight."""

from collections.abc import Sequence

import numpy as np

from facesynth.evaluation.pair import Array, UnavailableError, distances, mean_present, paired_points
from facesynth.evaluation.regions import upper_face_points
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion


def velocity_error(synthesised: Motion, truth: Motion) -> float:
    """Mean over frames and points of ‖dx - dy‖ · fps (u/s), d the first difference."""
    mine, yours = paired_points(synthesised, truth)
    _require_frames(truth, 2)
    return mean_present(distances(np.diff(mine, axis=0), np.diff(yours, axis=0))) * truth.fps


def fdd(synthesised: Motion, truth: Motion) -> float:
    """Upper-face dynamics deviation (u), signed: positive where the synthesised face moves too little.

    Per upper-face point the standard deviation over time of ‖y - rest‖ minus the same of x; mean over points.
    """
    return mean_present(_dynamics_deviation(synthesised, truth))


def fdd_abs(synthesised: Motion, truth: Motion) -> float:
    """The absolute value of `fdd` of the utterance (u), so that utterances do not cancel in a mean."""
    return abs(fdd(synthesised, truth))


def jerk_ratio(synthesised: Motion, truth: Motion) -> float:
    """Mean squared third difference over all channels, over the truth's (1).

    1 is natural, under 1 smoothed away, over 1 invented. Sensor noise of the truth counts as its jerk.
    """
    mine, yours = paired_points(synthesised, truth)
    _require_frames(truth, 4)
    return _ratio(mean_present(np.diff(mine, 3, axis=0) ** 2), mean_present(np.diff(yours, 3, axis=0) ** 2))


def energy_ratio(synthesised: Motion, truth: Motion) -> float:
    """Speed summed over frames and points, over the truth's (1); 1 = neither smoothed away nor invented."""
    mine, yours = paired_points(synthesised, truth)
    _require_frames(truth, 2)
    return _ratio(mean_present(_speeds(mine)), mean_present(_speeds(yours)))


def join_jump(synthesised: Motion, joins: Sequence[int]) -> float:
    """Mean change of velocity at the joins of a concatenative method, over its mean elsewhere (1).

    `joins` are the first frames of the pieces. The change of velocity at frame t is
    ‖x_{t+1} - 2 x_t + x_{t-1}‖ over all channels; a join j touches the two at j - 1 and j.
    1 = joins cannot be told from the rest.
    """
    _require_frames(synthesised, 3)
    change = np.linalg.norm(np.diff(synthesised.frames.astype(np.float64), 2, axis=0), axis=1)
    at_join = np.zeros(len(change), bool)
    for join in joins:
        if not 0 < join < len(synthesised):
            raise FacesynthError(f"join {join} is outside the motion's frames 1 to {len(synthesised) - 1}")
        at_join[max(join - 2, 0) : join] = True  # change[t - 1] is the one at frame t
    if not at_join.any() or at_join.all():
        raise UnavailableError("the motion has no joins, or nothing but joins")
    return _ratio(float(change[at_join].mean()), float(change[~at_join].mean()))


def _dynamics_deviation(synthesised: Motion, truth: Motion) -> Array:
    """[K'] deviation of each upper-face point."""
    mine, yours = paired_points(synthesised, truth)
    if truth.layout.neutral is None:
        raise UnavailableError("the layout states no rest pose")
    upper = upper_face_points(truth.layout)
    rest = truth.layout.points(np.asarray(truth.layout.neutral))[upper]
    away = [np.linalg.norm(points[:, upper] - rest, axis=2) for points in (mine, yours)]
    return _std_present(away[1]) - _std_present(away[0])


def _std_present(values: Array) -> Array:
    """[K] standard deviation over time of [T, K], NaN samples left out, NaN where a column is all NaN."""
    seen = ~np.isnan(values)
    count = np.where(seen.any(axis=0), seen.sum(axis=0), np.nan)
    mean = np.where(seen, values, 0.0).sum(axis=0) / count
    return np.asarray(np.sqrt((np.where(seen, values - mean, 0.0) ** 2).sum(axis=0) / count))


def _speeds(points: Array) -> Array:
    return np.asarray(np.linalg.norm(np.diff(points, axis=0), axis=2))


def _ratio(mine: float, yours: float) -> float:
    if not yours > 0:
        raise UnavailableError("the motion to compare with does not move")
    return mine / yours


def _require_frames(motion: Motion, least: int) -> None:
    if len(motion) < least:
        raise UnavailableError(f"it takes {least} frames; the motion has {len(motion)}")
