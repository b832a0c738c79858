"""Models that come with facesynth, or were pulled, lie as exported folders already: exporting one by its name copies it."""

import json
import shutil
import tempfile
from pathlib import Path
from typing import Any

from facesynth.inference.errors import FacesynthError
from facesynth.inference.folder import CARD, MANIFEST, open_folder
from facesynth.zoo.shelf import names


def is_packaged(model: Path) -> bool:
    """Whether this is the name of such a model, and no file."""
    return not model.exists() and str(model) in names()


def copy_packaged(model: Path, output: Path, *, changed: bool) -> dict[str, Any]:
    """Copy a model's folder, whose files are compared with their hashes first; its manifest.

    changed: whether other weights or a second model were asked for. FacesynthError there, and where something lies in the way.
    """
    folder = names()[str(model)]
    if changed:
        raise FacesynthError(
            f"{model} comes exported, with weights in float32; --weights and --beside want a model that was trained"
        )
    if output.exists() and (not output.is_dir() or any(output.iterdir())):
        raise FacesynthError(f"{output} is there and not empty; name a new folder for {model}")
    contents = open_folder(folder).contents
    output.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=output.parent) as beside:
        part = Path(beside) / output.name
        part.mkdir()
        for name, content in contents.items():  # some of them lie beside the folder, for several models
            (part / name).write_bytes(content)
        for name in (MANIFEST, CARD):
            shutil.copyfile(folder / name, part / name)
        if output.exists():
            output.rmdir()
        part.rename(output)
    manifest: dict[str, Any] = json.loads((output / MANIFEST).read_text(encoding="utf-8"))
    return manifest
