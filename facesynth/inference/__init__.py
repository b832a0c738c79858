"""Talking, feeling faces from trained models, with numpy and onnxruntime alone.

This folder is a part of facesynth and, by itself, the distribution facesynth-runtime: it imports nothing of what lies around
it, and names its own modules relatively.

>>> model = load("folder")                                    # doctest: +SKIP
>>> motion = model.synthesize(speech, seed=0)                 # doctest: +SKIP
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .version import __version__

if TYPE_CHECKING:
    from .errors import FacesynthError
    from .layout import Layout
    from .loading import load
    from .motion import Motion
    from .sound import Resampler, resample
    from .speech import EmotionTrack, PhoneTrack, Speech

__all__ = [
    "EmotionTrack",
    "FacesynthError",
    "Layout",
    "Motion",
    "PhoneTrack",
    "Resampler",
    "Speech",
    "__version__",
    "load",
    "resample",
]

_HOMES = {
    "EmotionTrack": "speech",
    "FacesynthError": "errors",
    "Layout": "layout",
    "Motion": "motion",
    "PhoneTrack": "speech",
    "Resampler": "sound",
    "Speech": "speech",
    "load": "loading",
    "resample": "sound",
}


def __getattr__(name: str) -> Any:
    """What the package offers is imported when it is asked for: naming an error must not load numpy."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_HOMES[name]}", __name__), name)
