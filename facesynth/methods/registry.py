"""Which methods exist, and how to make, save and load one by name."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from facesynth.inference.errors import FacesynthError, unknown
from facesynth.methods.method import Method, read_header

_MODULES = {
    "efase": "facesynth.methods.efase.method",
    "anime_graph": "facesynth.methods.anime_graph.method",
    "lds": "facesynth.methods.lds.method",
    "mean_face": "facesynth.methods.baselines.mean_face",
    "phone_mean": "facesynth.methods.baselines.phone_mean",
    "ridge": "facesynth.methods.baselines.ridge",
    "tcn": "facesynth.methods.baselines.tcn",
}
_CLASSES: dict[str, type[Method]] = {}


def register(name: str) -> Callable[[type[Method]], type[Method]]:
    """Class decorator: make a method known under `name`."""

    def add(cls: type[Method]) -> type[Method]:
        cls.name = name
        _CLASSES[name] = cls
        return cls

    return add


def list_methods() -> list[str]:
    """Names that `create` knows."""
    return sorted({*_MODULES, *_CLASSES})


def method_class(name: str) -> type[Method]:
    """The class behind a name; FacesynthError with the nearest names where there is none."""
    if name not in _CLASSES and name in _MODULES:
        importlib.import_module(_MODULES[name])
    if name not in _CLASSES:
        raise unknown("method", name, list_methods())
    return _CLASSES[name]


def create(name: str, **config: Any) -> Method:
    """A new, untrained method; unknown config keys are answered with the nearest known one."""
    return method_class(name).from_config(config)


def load(path: str | Path) -> Method:
    """A trained method from a file that `Method.save` wrote; FacesynthError for anything else."""
    header = read_header(path)
    try:
        return method_class(header["method"]).load(path)
    except (KeyError, IndexError, AttributeError, TypeError, RuntimeError) as error:
        raise FacesynthError(f"{path} is damaged, or another version wrote it ({error!r}); train it again") from error
