"""NPZ files that may be damaged or a stranger's: their size is looked at before they are unpacked, and nothing is unpickled."""

from __future__ import annotations

import zipfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from facesynth.inference.errors import FacesynthError

LARGEST_BYTES = 2**31


def read_arrays(path: str | Path, names: Iterable[str], what: str) -> dict[str, Any]:
    """The named arrays of an NPZ file; FacesynthError where it is missing, damaged, lacks one, or would unpack to gigabytes.

    `what` says what the file should hold, for the error.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            size = sum(entry.file_size for entry in archive.infolist())
        if size > LARGEST_BYTES:
            raise FacesynthError(f"{path} would unpack to {size / 1e9:.1f} GB, which is no {what}")
        with open(path, "rb") as file, np.load(file, allow_pickle=False) as stored:
            return {name: stored[name] for name in names}
    except (
        OSError,
        KeyError,
        EOFError,
        AttributeError,
        TypeError,
        MemoryError,
        NotImplementedError,
        zipfile.BadZipFile,
    ) as error:
        raise FacesynthError(f"{path} holds no {what}, or is damaged ({error})") from None
    except ValueError as error:
        if isinstance(error, FacesynthError):
            raise
        raise FacesynthError(f"{path} holds no {what}, or is damaged ({error})") from None
