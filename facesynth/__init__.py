"""Talking, feeling faces driven by speech, learned from recordings of one performer.

>>> model = create("efase").fit(Corpus.open("my_actor"))                      # doctest: +SKIP
>>> model.save("model.safetensors")                                           # doctest: +SKIP
>>> speak("model.safetensors", "hello.wav", "hello.mp4", text="Hello there")  # doctest: +SKIP
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from facesynth.inference.version import __version__

if TYPE_CHECKING:
    from facesynth.corpus import Corpus
    from facesynth.inference.motion import Motion
    from facesynth.inference.speech import Speech
    from facesynth.methods.registry import create, list_methods
    from facesynth.stage.speaking import speak
    from facesynth.zoo.shelf import load

__all__ = ["Corpus", "Motion", "Speech", "__version__", "create", "list_methods", "load", "speak"]

_HOMES = {
    "Corpus": "corpus",
    "Motion": "inference.motion",
    "Speech": "inference.speech",
    "create": "methods.registry",
    "list_methods": "methods.registry",
    "load": "zoo.shelf",
    "speak": "stage.speaking",
}


def __getattr__(name: str) -> Any:
    """What the package offers is imported when it is asked for: naming a version must not load torch."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"facesynth.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
