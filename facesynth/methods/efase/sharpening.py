"""A mean of many motions moves too little; what it has of quick movement is raised."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy.ndimage import gaussian_filter1d

from facesynth.inference.motion import Motion
from facesynth.methods.efase.nodes import Floats

QUICK_S = 0.08
"""Standard deviation of the smoothing that parts slow movement from quick."""
ROUGH_S = 0.02
"""What is quicker than this is joints and the noise of sensors: it is smoothed away, not raised."""
SHARES = np.linspace(0, 2, 9)
"""Where a share is looked for; more would be a caricature."""


def sharpen(frames: Floats, share: float, fps: float) -> Floats:
    """`y + share (y - slow y)`, y the frames [T, D] without roughness; share 0 leaves them as they are.

    Nothing new is made up, and a pose that is held stays. Raised as well, the roughness would double the jerk of
    natural motion; this way both the energy and the jerk of a mean come near those of recordings.
    """
    if share == 0:
        return frames
    smooth = _smooth(frames, fps)
    return smooth + share * (smooth - gaussian_filter1d(smooth, QUICK_S * fps, axis=0, mode="nearest"))


def matching_share(pairs: Iterable[tuple[Motion, Motion]]) -> float:
    """The share with which motion moves as much as recorded, by pairs (unsharpened, recorded) of one rate.

    Compared are mean speeds without roughness, of which a sensor's noise would be the larger part, over the frames
    that were recorded. From 0, where nothing is missing, to the last of SHARES.
    """
    ratios = np.mean([_speed_ratios(made, truth) for made, truth in pairs], axis=0)
    return float(np.interp(1.0, ratios, SHARES))


def _speed_ratios(made: Motion, truth: Motion) -> Floats:
    """[S] mean speed of a motion sharpened by each of SHARES over that of the recording."""
    count, fps = min(len(made), len(truth)), truth.fps
    recorded = _speeds(truth, _smooth(truth.frames[:count].astype(np.float64), fps))
    present = np.isfinite(recorded)
    sharp = [sharpen(made.frames[:count].astype(np.float64), share, fps) for share in SHARES]
    made_speeds = [_speeds(made, _smooth(frames, fps))[present].mean() for frames in sharp]
    return np.array(made_speeds) / max(recorded[present].mean(), 1e-12)


def _speeds(motion: Motion, frames: Floats) -> Floats:
    """[T - 1, K] how far each point of a motion's layout goes from frame to frame."""
    return np.asarray(np.linalg.norm(np.diff(motion.layout.points(frames), axis=0), axis=2))


def _smooth(frames: Floats, fps: float) -> Floats:
    return np.asarray(gaussian_filter1d(frames, ROUGH_S * fps, axis=0, mode="nearest"))
