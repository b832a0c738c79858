"""Writing an exported folder: graphs, arrays, manifest."""

import json
import platform
import shutil
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth import __version__
from facesynth.export.graph import Graph, Parity, check_parity
from facesynth.hashing import hash_file
from facesynth.inference.errors import FacesynthError
from facesynth.inference.folder import ARRAYS, CARD, FORMAT, MANIFEST, OPSET, digest
from facesynth.inference.phones import PHONES, viseme_of
from facesynth.progress import track


@dataclass(frozen=True, eq=False)
class Content:
    """What a method puts into a folder."""

    graphs: tuple[Graph, ...]
    settings: Mapping[str, Any]
    """Numbers and names that the runtime needs beside the graphs; JSON values."""
    latency: Mapping[str, Any]
    sample_rate: int | None = None
    """Hz of the sound that it listens to."""
    arrays: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    """Of the arrays."""
    rounding: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    """Mean and largest error of arrays that are kept in fewer bits, in their units."""
    derived: Callable[[Mapping[str, NDArray[Any]]], Mapping[str, NDArray[Any]]] | None = None
    """More arrays, which follow from the others as they are stored."""


@dataclass(frozen=True)
class Subject:
    """What is said of the model as a whole."""

    method: str
    training_data: Mapping[str, Any]
    """Performer, licences, consents as the corpus states them; the last two are "unknown" where they are missing."""
    layout: Mapping[str, Any] | None
    fps: float | None
    emotions: tuple[str, ...]


def write_folder(folder: str | Path, subject: Subject, content: Content) -> dict[str, Any]:
    """Check every graph, then write the folder, whole or not at all; returns the manifest.

    A folder that was exported before is replaced, all but its card; any other one is left alone.
    """
    folder = Path(folder)
    _require_free(folder)
    if content.derived:
        content = replace(content, arrays={**content.arrays, **content.derived(content.arrays)})
    parities = {graph.name: check_parity(graph) for graph in track(content.graphs, "checking graphs")}
    folder.parent.mkdir(parents=True, exist_ok=True)
    part = Path(tempfile.mkdtemp(prefix=".part-", dir=folder.parent))
    try:
        part.chmod(0o755)
        for graph in content.graphs:
            (part / f"{graph.name}.onnx").write_bytes(graph.model.SerializeToString())
        if content.arrays:
            np.savez(part / ARRAYS, allow_pickle=False, **content.arrays)
        manifest = _manifest(part, subject, content, parities)
        (part / MANIFEST).write_text(json.dumps(manifest, indent=1, sort_keys=True) + "\n", encoding="utf-8")
        if (card := folder / CARD).is_file():
            shutil.copyfile(card, part / CARD)
        if folder.exists():
            shutil.rmtree(folder)
        part.rename(folder)
    finally:
        shutil.rmtree(part, ignore_errors=True)
    return manifest


def _require_free(folder: Path) -> None:
    if folder.is_file():
        raise FacesynthError(f"{folder} is a file; name a folder to export to")
    if folder.is_dir() and any(folder.iterdir()) and not (folder / MANIFEST).is_file():
        raise FacesynthError(f"{folder} holds other files and was not exported by facesynth; name an empty folder")


def _manifest(part: Path, subject: Subject, content: Content, parities: Mapping[str, Parity]) -> dict[str, Any]:
    files = sorted(path for path in part.iterdir())
    manifest: dict[str, Any] = {
        "format": FORMAT,
        "written_by": "facesynth",
        "method": subject.method,
        "opset": OPSET,
        "versions": {name: version(name) for name in ("onnx", "onnxruntime", "numpy", "torch")}
        | {"facesynth": __version__, "python": platform.python_version()},
        "files": {path.name: {"sha256": hash_file(path), "bytes": path.stat().st_size} for path in files},
        "graphs": {graph.name: _entry(graph, parities[graph.name]) for graph in content.graphs},
        "arrays": {
            name: {"dtype": str(a.dtype), "shape": list(a.shape), "unit": content.units.get(name, "none")}
            | ({"rounding": dict(content.rounding[name])} if name in content.rounding else {})
            for name, a in content.arrays.items()
        },
        "layout": subject.layout,
        "fps": subject.fps,
        "sample_rate": content.sample_rate,
        "emotions": list(subject.emotions),
        "phones": [[phone, viseme_of(phone)] for phone in PHONES],
        "settings": dict(content.settings),
        "latency": dict(content.latency),
        "training_data": {"licences": ["unknown"], "consents": ["unknown"], **subject.training_data},
    }
    return {**manifest, "sha256": digest(manifest)}


def _entry(graph: Graph, parity: Parity) -> dict[str, Any]:
    return {
        "file": f"{graph.name}.onnx",
        "about": graph.about,
        "inputs": [port.to_dict() for port in graph.inputs],
        "outputs": [port.to_dict() for port in graph.outputs],
        "parity": {"largest_relative_difference": parity.relative, "batch_and_length": [list(s) for s in parity.sizes]},
    }
