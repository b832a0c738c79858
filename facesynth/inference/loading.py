"""From a folder to a model."""

import importlib
from pathlib import Path
from typing import Any

from .errors import FacesynthError, unknown
from .folder import open_folder, stated_by_manifest

_MODELS = {
    "network": ".network:load_network",
    "lds": ".lds:load_lds",
    "emotion": ".emotion:load_detector",
    "efase": ".efase.exported:load_efase",
    "anime_graph": ".anime_graph.exported:load_anime_graph",
    "coarticulation": ".coarticulation.model:load_coarticulation",
    "eyes": ".eyes:load_eyes",
    "head_knn": ".head.exported:load_head_knn",
    "head_hmm": ".head.exported:load_head_hmm",
    "expression": ".expression:load_expression",
    "phones": ".phone_hearing:load_phones",
    "graphs": ".parts:Parts",
}


def load(folder: str | Path, *, threads: int = 1) -> Any:
    """The model in an exported folder, every file of which is verified; it is called like the torch model it came from.

    threads: of each onnxruntime session.
    """
    if not isinstance(threads, int) or threads < 1:
        raise FacesynthError(f"threads is {threads!r}; wanted 1 or more")
    opened = open_folder(folder)
    method = opened.manifest["method"]
    if not isinstance(method, str) or method not in _MODELS:
        raise unknown(f"method in {opened.path / 'manifest.json'}", str(method), _MODELS)
    module, _, name = _MODELS[method].partition(":")
    model = getattr(importlib.import_module(module, __package__), name)
    with stated_by_manifest(opened.path):
        return model(opened, threads)
