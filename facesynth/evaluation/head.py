"""How close synthesised head rotation is to the recorded one (Deng 2006 table 4.1)."""

import numpy as np
from scipy.spatial.transform import Rotation

from facesynth.evaluation.pair import Array, UnavailableError, require_alike
from facesynth.inference.motion import Motion


def head_cca(synthesised: Motion, truth: Motion) -> float:
    """First canonical correlation of the two rotation vectors over time, 0..1; 0 where a head stands still."""
    mine, yours = _rotations(synthesised, truth)
    return canonical_correlation(mine, yours)


def canonical_correlation(signal: Array, truth: Array) -> float:
    """The largest of a signal [T, m] and a recorded one [T, n], 0..1; 0 where the first does not move.

    With orthonormal bases Q of both centred signals the canonical correlations are the singular
    values of Q_x^T Q_y.
    """
    if len(truth) < 8:
        raise UnavailableError("fewer than 8 frames with a head pose")
    bases = [_orthonormal(track - track.mean(axis=0)) for track in (signal, truth)]
    if not bases[1].shape[1]:
        raise UnavailableError("the recorded head stands still")
    if not bases[0].shape[1]:
        return 0.0
    return float(min(np.linalg.svd(bases[0].T @ bases[1], compute_uv=False)[0], 1.0))


def head_distance(synthesised: Motion, truth: Motion) -> float:
    """Mean over frames of the Euclidean distance of (yaw, pitch, roll) in degrees."""
    return float(head_distances(synthesised, truth).mean())


def head_distances(synthesised: Motion, truth: Motion) -> Array:
    """[T'] the same of each frame."""
    angles = [Rotation.from_rotvec(signal).as_euler("YXZ", degrees=True) for signal in _rotations(synthesised, truth)]
    difference = (angles[0] - angles[1] + 180.0) % 360.0 - 180.0
    return np.asarray(np.linalg.norm(difference, axis=1))


def _rotations(synthesised: Motion, truth: Motion) -> tuple[Array, Array]:
    """Rotation vectors [T', 3] (rad) of both in the frames in which both have one."""
    require_alike(synthesised, truth)
    if truth.head is None:
        raise UnavailableError("the recording has no head motion")
    if synthesised.head is None:
        raise UnavailableError("the method moves no head")
    mine, yours = synthesised.head[:, :3].astype(np.float64), truth.head[:, :3].astype(np.float64)
    present = ~(np.isnan(mine) | np.isnan(yours)).any(axis=1)
    if not present.any():
        raise UnavailableError("the recording has no head pose in any frame")
    return mine[present], yours[present]


def _orthonormal(signal: Array) -> Array:
    """[T, r] orthonormal basis of the columns of [T, 3]; r = 0 for a signal that does not move."""
    u, s, _ = np.linalg.svd(signal, full_matrices=False)
    return u[:, s > max(1e-9, 1e-6 * s[0])]
