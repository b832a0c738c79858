"""A mean of many motions moves too little; what it has of quick movement is raised."""

from __future__ import annotations

from scipy.ndimage import gaussian_filter1d

from facesynth.methods.efase.nodes import Floats

QUICK_S = 0.08
"""Standard deviation of the smoothing that parts slow movement from quick."""
ROUGH_S = 0.02
"""What is quicker than this is joints and the noise of sensors: it is smoothed away, not raised."""


def sharpen(frames: Floats, share: float, fps: float) -> Floats:
    """`y + share (y - slow y)`, y the frames [T, D] without roughness; share 0 leaves them as they are.

    Nothing new is made up, and a pose that is held stays. Raised as well, the roughness would double the jerk of
    natural motion; this way both the energy and the jerk of a mean come near those of recordings.
    """
    if share == 0:
        return frames
    smooth = gaussian_filter1d(frames, ROUGH_S * fps, axis=0, mode="nearest")
    return smooth + share * (smooth - gaussian_filter1d(smooth, QUICK_S * fps, axis=0, mode="nearest"))
