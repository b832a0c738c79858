"""Trained models on disk: one safetensors file, what is no tensor as JSON in its metadata; never pickle."""

import json
from collections.abc import Mapping
from errno import EIO
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import nn

from facesynth import __version__
from facesynth.atomic import atomic_path
from facesynth.inference.errors import FacesynthError

FORMAT = 2
"""Version of the model file; a file of another version is refused."""

Kinds = Mapping[str, type | tuple[type, ...]]
KINDS: Kinds = {"method": str, "config": dict, "emotions": list, "provenance": dict, "tensors": dict}
"""What the header of every model file holds, and of what kind."""


def write_model(path: str | Path, module: nn.Module, header: Mapping[str, Any]) -> None:
    """Write a module's buffers and parameters and its header, atomically."""
    tensors = {key: value.detach().cpu().contiguous() for key, value in module.state_dict().items()}
    shapes = {key: list(value.shape) for key, value in tensors.items()}
    whole = {**header, "tensors": shapes, "facesynth": __version__, "format": FORMAT}
    with atomic_path(path) as part:
        try:
            save_file(tensors, part, metadata={"facesynth": json.dumps(whole, sort_keys=True)})
        except SafetensorError as error:  # a full disk, a limit on file sizes
            raise OSError(EIO, f"the model cannot be written ({error})") from error


def read_header(path: str | Path, kinds: Kinds = KINDS, what: str = "a facesynth model") -> dict[str, Any]:
    """The header of a model file with what `kinds` names; FacesynthError says what is wrong with a file that has none.

    what: was wanted, for the error.
    """
    if not Path(path).is_file():
        raise FacesynthError(f"{path}: no such model file; train one with `facesynth train`")
    try:
        with safe_open(path, "pt") as file:
            text = (file.metadata() or {}).get("facesynth")
    except (SafetensorError, OSError) as error:
        raise FacesynthError(f"{path} is not {what}, or is truncated ({error})") from None
    if text is None:
        raise FacesynthError(f"{path} is a safetensors file without a facesynth header; it was not written by facesynth")
    try:
        header = json.loads(text)
    except ValueError:
        raise FacesynthError(f"{path} has a damaged facesynth header; train the model again") from None
    if not isinstance(header, dict):
        raise FacesynthError(f"{path} has a damaged facesynth header; train the model again")
    if header.get("format") != FORMAT:
        raise FacesynthError(f"{path} has model format {header.get('format')}; this facesynth reads {FORMAT}: train it again")
    if wrong := [key for key, kind in kinds.items() if not isinstance(header.get(key), kind)]:
        raise FacesynthError(f"{path} has a damaged facesynth header without {', '.join(wrong)}; train the model again")
    return header


def read_tensors(path: str | Path, module: nn.Module, header: Mapping[str, Any]) -> None:
    """Fill a module with the tensors of a model file, which must be those that its header states, in name and shape."""
    with safe_open(path, "pt") as file:
        tensors = {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118 - safe_open is no mapping
    stated, found = header["tensors"], {key: list(tensor.shape) for key, tensor in tensors.items()}
    for key in sorted({*stated, *found}):
        if found.get(key) != stated.get(key):
            raise FacesynthError(
                f"{path} is damaged: {key} has the shape {found.get(key)}, the header says {stated.get(key)}; train it again"
            )
    modules = dict(module.named_modules())
    for key, tensor in tensors.items():
        owner, _, leaf = key.rpartition(".")
        if owner not in modules:
            name = header["method"]
            raise FacesynthError(f"{path} was written by another version of {name}, which had a {owner}; train it again")
        _set(modules[owner], leaf, tensor)


def _set(module: nn.Module, name: str, value: torch.Tensor) -> None:
    if name in module._parameters:
        module._parameters[name] = nn.Parameter(value, requires_grad=False)
    else:
        module.register_buffer(name, value)
