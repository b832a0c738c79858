"""Smoothing the joint between two pieces of motion."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def smooth_joint(
    frames: Floats, joint: int, reach: int, weights: Floats, stiffness: float = 1.0, strength: float = 1.0
) -> Floats:
    """Frames [T, D] with a share `strength` of the jump between `joint - 1` and `joint` smoothed over `reach` frames each way.

    `min_g sum_k w_k (g_k - f_k)² + stiffness · ∫ g''²` (Deng 2008, eq. 13), a weighted cubic smoothing
    spline over the frame numbers; weights [T], large where a frame must stay. The correction g - f
    fades to 0 at the outer frames, since the spline would otherwise leave a new step there.
    """
    first, stop = max(joint - reach, 0), min(joint + reach, len(frames))
    piece = frames[first:stop]
    if len(piece) < 3:
        return frames
    spline = smoothing_spline if len(piece) >= 5 else _penalised
    correction = spline(piece, weights[first:stop], stiffness) - piece
    rise = np.clip(np.arange(len(piece)) / max(joint - first - 1, 1), 0, 1)
    fall = np.clip(np.arange(len(piece))[::-1] / max(stop - joint - 1, 1), 0, 1)
    smooth = frames.copy()
    smooth[first:stop] = piece + strength * np.minimum(rise, fall)[:, None] * correction
    return smooth


def smoothing_spline(piece: Floats, weights: Floats, stiffness: float) -> Floats:
    """Frames [n, C], n >= 5, of `min sum w_k (g_k - f_k)² + stiffness ∫ g''²`, the natural cubic smoothing spline (Reinsch)."""
    count = len(piece)
    Q = np.zeros((count, count - 2))
    k = np.arange(count - 2)
    Q[k, k], Q[k + 1, k], Q[k + 2, k] = 1.0, -2.0, 1.0
    R = np.diag(np.full(count - 2, 2 / 3)) + np.diag(np.full(count - 3, 1 / 6), 1) + np.diag(np.full(count - 3, 1 / 6), -1)
    spread = Q / weights[:, None]
    return np.asarray(piece - stiffness * spread @ np.linalg.solve(R + stiffness * Q.T @ spread, Q.T @ piece))


def _penalised(piece: Floats, weights: Floats, stiffness: float) -> Floats:
    """The same with second differences for the derivative, where there are too few frames for a spline."""
    bend = np.diff(np.eye(len(piece)), n=2, axis=0)
    return np.asarray(np.linalg.solve(np.diag(weights) + stiffness * bend.T @ bend, weights[:, None] * piece))
