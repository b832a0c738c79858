"""From a folder to a model."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

from facesynth_runtime.errors import RuntimeInputError, unknown
from facesynth_runtime.folder import open_folder

_MODELS = {
    "lds": "facesynth_runtime.lds:Lds",
    "emotion": "facesynth_runtime.emotion:EmotionDetector",
    "efase": "facesynth_runtime.efase:Efase",
    "anime_graph": "facesynth_runtime.anime_graph:AnimeGraph",
    "graphs": "facesynth_runtime.parts:Parts",
}


def load(folder: str | Path, *, threads: int = 1) -> Any:
    """The model in an exported folder, every file of which is verified; it is called like the torch model it came from.

    threads: of each onnxruntime session.
    """
    if threads < 1:
        raise RuntimeInputError(f"threads is {threads}; wanted 1 or more")
    opened = open_folder(folder)
    method = opened.manifest["method"]
    if method not in _MODELS:
        raise unknown(f"method in {opened.path / 'manifest.json'}", method, _MODELS)
    module, _, name = _MODELS[method].partition(":")
    return getattr(importlib.import_module(module), name)(opened, threads)
