"""An exported folder: nothing in it is used before its hash is found right."""

import hashlib
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from .errors import FacesynthError
from .layout import Layout
from .npz import view_arrays

FORMAT = 3
"""Of the manifest: one is written, no other is read."""
MANIFEST = "manifest.json"
LARGEST_MANIFEST_BYTES = 1 << 24
ARRAYS = "arrays.npz"
CARD = "card.yaml"
"""What whoever takes the model must know; it may be corrected, so the manifest does not list it."""
OPSET = 20
"""Of the graphs."""
KEYS = (
    "format", "method", "opset", "files", "graphs", "arrays", "layout", "fps", "sample_rate", "settings", "latency", "emotions",
    "phones", "training_data", "sha256",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Folder:
    """A verified folder."""

    path: Path
    manifest: dict[str, Any]
    contents: dict[str, bytes]
    """Of every file, as it was when its hash was found right: nothing is read a second time."""

    @property
    def settings(self) -> dict[str, Any]:
        """What the method needs beside graphs and arrays."""
        settings: dict[str, Any] = self.manifest["settings"]
        return settings

    @property
    def layout(self) -> Layout:
        """Of the motion; FacesynthError where the manifest states none that can be."""
        try:
            return Layout.from_dict(self.manifest["layout"])
        except FacesynthError as error:
            raise FacesynthError(f"{self.path / MANIFEST}: {error}; export the model again") from None

    def bytes_of(self, name: str) -> bytes:
        """A file's content; FacesynthError where the manifest does not list it."""
        if name not in self.contents:
            raise FacesynthError(f"{self.path / name} is not listed in the manifest; export the model again")
        return self.contents[name]

    def arrays(self) -> dict[str, NDArray[Any]]:
        """All arrays, with the types and shapes that the manifest states; they cannot be written to."""
        path, content = self.path / ARRAYS, self.bytes_of(ARRAYS)
        try:
            found = view_arrays(content, self.manifest["arrays"])
        except FacesynthError as error:
            raise FacesynthError(f"{path}: {error}; export the model again") from None
        for name, wanted in self.manifest["arrays"].items():
            got = found[name]
            if list(got.shape) != wanted["shape"] or str(got.dtype) != wanted["dtype"]:
                raise FacesynthError(
                    f"{path}: {name} is {got.dtype} {list(got.shape)}; the manifest wants {wanted['dtype']} {wanted['shape']}"
                )
        return found


@contextmanager
def stated_by_manifest(folder: Path) -> Iterator[None]:
    """Whoever may write a manifest may leave things out of it: what is missing or odd is named in place of a traceback."""
    try:
        yield
    except FacesynthError:
        raise
    except (KeyError, IndexError) as error:
        raise FacesynthError(f"{folder / MANIFEST} lacks {error}; export the model again") from None
    except (TypeError, AttributeError, ValueError, OverflowError) as error:
        raise FacesynthError(f"{folder / MANIFEST} states what cannot be ({error}); export the model again") from None
    except RecursionError:
        raise FacesynthError(f"{folder / MANIFEST} is nested too deeply for a manifest; export the model again") from None


def open_folder(path: str | Path) -> Folder:
    """Read the manifest and compare the hash of every file with it; FacesynthError names the file that is wrong.

    What several models have alike, such as the network that hears phones, may lie once, beside their folders.
    """
    folder, contents = Path(path), {}
    with stated_by_manifest(folder):
        manifest = _manifest(folder / MANIFEST)
        for name, wanted in manifest["files"].items():
            if Path(name).name != name:
                raise FacesynthError(f"{folder / MANIFEST} names {name!r}, which is not a file of this folder")
            contents[name] = checked_bytes(place_of(folder, name), wanted)
    return Folder(folder, manifest, contents)


def place_of(folder: Path, name: str) -> Path:
    """Where a file of a model lies: in its folder, or beside it where only there."""
    own, shared = folder / name, folder.parent / name
    return shared if shared.is_file() and not own.exists() else own


def checked_bytes(path: Path, wanted: Any) -> bytes:
    """The content of a file whose size and sha256 are as wanted."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise FacesynthError(f"{path}: {error.strerror or 'cannot be read'}; copy the whole folder, or export it again") from None
    if len(content) != wanted["bytes"]:
        raise FacesynthError(f"{path} has {len(content)} bytes; wanted {wanted['bytes']}: it is truncated or of another export")
    if hashlib.sha256(content).hexdigest() != wanted["sha256"]:
        raise FacesynthError(f"{path} does not have the hash that the manifest states: it was changed or is of another export")
    return content


def _manifest(path: Path) -> dict[str, Any]:
    try:
        if path.stat().st_size > LARGEST_MANIFEST_BYTES:
            raise FacesynthError(f"{path} is too large for a manifest")
        manifest = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise FacesynthError(f"{path}: no such file; wanted a folder written by `facesynth export`") from None
    except (OSError, ValueError) as error:
        raise FacesynthError(f"{path} is damaged or no manifest ({error}); export the model again") from None
    if not isinstance(manifest, dict) or manifest.get("written_by") != "facesynth":
        raise FacesynthError(f"{path} was not written by `facesynth export`")
    if lacking := [key for key in KEYS if key not in manifest]:
        raise FacesynthError(f"{path} lacks {', '.join(lacking)}; export the model again")
    if manifest["format"] != FORMAT:
        raise FacesynthError(f"{path} has format {manifest['format']}; this runtime reads {FORMAT}: export the model again")
    if manifest["opset"] != OPSET:
        raise FacesynthError(
            f"{path} states opset {manifest['opset']}; this runtime knows {OPSET}: export it again, or take a newer one"
        )
    if digest(manifest) != manifest["sha256"]:
        raise FacesynthError(f"{path} was changed after it was written; export the model again")
    return manifest


def digest(manifest: Mapping[str, Any]) -> str:
    """sha256 of the manifest without its own hash, keys sorted."""
    plain = {key: value for key, value in manifest.items() if key != "sha256"}
    return hashlib.sha256(json.dumps(plain, sort_keys=True, separators=(",", ":")).encode()).hexdigest()
