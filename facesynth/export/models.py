"""Which models can be exported, and how a model file becomes a folder."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

from facesynth.export.folder import Subject, write_folder
from facesynth.export.weights import Weights, stored_as
from facesynth.inference.errors import FacesynthError
from facesynth.methods.emotion.detector import EmotionDetector
from facesynth.methods.method import Method
from facesynth.methods.model_file import read_header
from facesynth.methods.registry import load

_CONTENTS = {
    "lds": "facesynth.export.lds:lds_content",
    "efase": "facesynth.export.efase:efase_content",
    "anime_graph": "facesynth.export.anime_graph:anime_graph_content",
}


def export_model(
    path: str | Path, folder: str | Path, weights: Weights = "float32", *, only: str | None = None
) -> dict[str, Any]:
    """Write a folder that runs without torch; returns its manifest. FacesynthError where a graph is not exact enough.

    only: the one method that is wanted; a model of another is refused.
    """
    model = open_model(path)
    if only not in (None, model.name):
        raise FacesynthError(f"{path} holds a model of method {model.name!r}; wanted {only}. `facesynth export` takes any")
    if isinstance(model, EmotionDetector):
        from facesynth.export.emotion import emotion_content

        subject = Subject(model.name, model.provenance, None, None, model.emotions)
        return write_folder(folder, subject, stored_as(emotion_content(model), weights))
    if model.name not in _CONTENTS:
        raise FacesynthError(f"{path} holds a model of method {model.name!r}; wanted one of {', '.join(_CONTENTS)}, or emotion")
    module, _, name = _CONTENTS[model.name].partition(":")
    content = getattr(importlib.import_module(module), name)(model)
    subject = Subject(model.name, model.provenance, model.fitted_layout.to_dict(), model.fps, model.emotions)
    return write_folder(folder, subject, stored_as(content, weights))


def open_model(path: str | Path) -> Method | EmotionDetector:
    """A method or an emotion detector, whichever the file holds."""
    return EmotionDetector.load(path) if read_header(path)["method"] == EmotionDetector.name else load(path)
