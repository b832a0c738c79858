"""A mean of many motions moves too little; what it has of quick movement is raised."""

from __future__ import annotations

from scipy.ndimage import gaussian_filter1d

from facesynth.methods.efase.nodes import Floats

QUICK_S = 0.08
"""Standard deviation of the smoothing that parts slow movement from quick."""


def sharpen(frames: Floats, share: float, fps: float) -> Floats:
    """`x + share (x - smoothed x)`, frames [T, D]: nothing new is made up, and a pose that is held stays."""
    return frames + share * (frames - gaussian_filter1d(frames, QUICK_S * fps, axis=0, mode="nearest"))
