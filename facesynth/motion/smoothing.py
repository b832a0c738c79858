"""Smoothing the joint between two pieces of motion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_smoothing_spline

Floats = NDArray[np.float64]


def smooth_joint(frames: Floats, joint: int, reach: int, weights: Floats, stiffness: float = 1.0) -> Floats:
    """Frames [T, D] with the jump between `joint - 1` and `joint` smoothed over `reach` frames on either side.

    `min_g sum_k w_k (g_k - f_k)² + stiffness · ∫ g''²` (Deng 2008, eq. 13), a weighted cubic smoothing
    spline over the frame numbers; weights [T], large where a frame must stay. The correction g - f
    fades to 0 at the outer frames, since the spline would otherwise leave a new step there.
    """
    first, stop = max(joint - reach, 0), min(joint + reach, len(frames))
    piece = frames[first:stop]
    if len(piece) < 3:
        return frames
    spline = _spline if len(piece) >= 5 else _penalised
    correction = spline(piece, weights[first:stop], stiffness) - piece
    rise = np.clip(np.arange(len(piece)) / max(joint - first - 1, 1), 0, 1)
    fall = np.clip(np.arange(len(piece))[::-1] / max(stop - joint - 1, 1), 0, 1)
    smooth = frames.copy()
    smooth[first:stop] = piece + np.minimum(rise, fall)[:, None] * correction
    return smooth


def _spline(piece: Floats, weights: Floats, stiffness: float) -> Floats:
    at = np.arange(len(piece), dtype=float)
    smooth: Floats = make_smoothing_spline(at, piece, w=weights, lam=stiffness)(at).astype(np.float64)
    return smooth


def _penalised(piece: Floats, weights: Floats, stiffness: float) -> Floats:
    """The same with second differences for the derivative: SciPy's spline wants five points."""
    bend = np.diff(np.eye(len(piece)), n=2, axis=0)
    return np.linalg.solve(np.diag(weights) + stiffness * bend.T @ bend, weights[:, None] * piece).astype(np.float64)
