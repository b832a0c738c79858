"""Talking, feeling faces exported by facesynth, run with numpy and onnxruntime alone.

>>> model = load("folder")                                    # doctest: +SKIP
>>> motion = model.synthesize(speech, seed=0)                 # doctest: +SKIP
"""

from facesynth_runtime.errors import RuntimeInputError
from facesynth_runtime.load import load
from facesynth_runtime.sound import Resampler, resample
from facesynth_runtime.tracks import EmotionTrack, Layout, Motion, PhoneTrack, Speech

__version__ = "0.1.0"
__all__ = [
    "EmotionTrack",
    "Layout",
    "Motion",
    "PhoneTrack",
    "Resampler",
    "RuntimeInputError",
    "Speech",
    "__version__",
    "load",
    "resample",
]
