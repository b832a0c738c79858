"""Arrays of NPZ files that may be damaged or a stranger's: they can fail, not harm.

The size is looked at before anything is unpacked, nothing is unpickled, and whatever numpy and zipfile stumble over ends in
one line.
"""

import io
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from .errors import FacesynthError
from .long_arrays import BLOCK_BYTES, LARGE_BYTES, Growing, row_blocks

LARGEST_BYTES = 2**30
"""Of a file once unpacked, as its list of contents states before anything is unpacked; what is larger is no single recording
and no model. Three hours of 90 points at 100 Hz are 1.2 GB: they are to be split."""
LARGEST_HEADER_BYTES = 1 << 16
"""Of an array in a file."""
DAMAGE = (
    *(OSError, ValueError, EOFError, LookupError, TypeError, AttributeError, MemoryError, RuntimeError, ArithmeticError),
    *(SyntaxError, tokenize.TokenError, struct.error, zlib.error, zipfile.BadZipFile),
)
"""What numpy's and zipfile's own code raises on a damaged archive, or on a damaged array in it: each was seen on files with
bytes changed at random. Only their code runs where these are caught."""


def read_arrays(path: str | Path, what: str, required: Iterable[str], optional: Iterable[str] = ()) -> dict[str, NDArray[Any]]:
    """The required arrays of an NPZ file, and those of the optional ones that it holds.

    FacesynthError where the file is missing, damaged, lacks one, or would unpack to gigabytes; `what` says what it should be.
    """
    required = list(required)
    arrays = _read(Path(path), what, {*required, *optional})
    if lacking := [name for name in required if name not in arrays]:
        raise FacesynthError(f"{path} is not {what}: it holds no array {', '.join(map(repr, lacking))}")
    return arrays


def read_all_arrays(path: str | Path, what: str) -> dict[str, NDArray[Any]]:
    """Every array of an NPZ file; FacesynthError as from `read_arrays`."""
    return _read(Path(path), what, None)


def view_arrays(content: bytes, names: Iterable[str]) -> dict[str, NDArray[Any]]:
    """Arrays of an uncompressed NPZ as views of its bytes: nothing is copied. FacesynthError for other bytes."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            return {name: _view(content, archive.getinfo(f"{name}.npy")) for name in names}
    except DAMAGE as error:
        raise FacesynthError(f"cannot be read ({_reason(error)})") from None


def _read(path: Path, what: str, wanted: set[str] | None) -> dict[str, NDArray[Any]]:
    if not path.is_file():
        raise FacesynthError(f"{path} is not {what}: the file is missing")
    try:
        with zipfile.ZipFile(path) as archive:
            sizes = {entry.filename: entry.file_size for entry in archive.infolist()}
            size = sum(sizes.values())
    except DAMAGE as error:
        raise FacesynthError(_no_archive(path, what, error)) from None
    if size > LARGEST_BYTES:
        raise FacesynthError(f"{path} would unpack to {size / 1e9:.1f} GB, more than {what} can hold; split it")
    try:
        with open(path, "rb") as file, np.load(file, allow_pickle=False) as stored:
            names = [name for name in stored.files if wanted is None or name in wanted]
            return {name: _large(path, name) if sizes.get(f"{name}.npy", 0) > LARGE_BYTES else stored[name] for name in names}
    except DAMAGE as error:
        raise FacesynthError(f"{path} is not {what}, or is damaged ({_reason(error)})") from None


def _large(path: Path, name: str) -> NDArray[Any]:
    """An array that is read piece by piece, into a file that is mapped."""
    with zipfile.ZipFile(path) as archive, archive.open(f"{name}.npy") as member:
        shape, in_columns, dtype = _header(member)
        if dtype.hasobject:
            raise ValueError(f"{name} holds objects")
        pieces = Growing(dtype)
        while piece := member.read(BLOCK_BYTES // dtype.itemsize * dtype.itemsize):
            pieces.add(np.frombuffer(piece, dtype))
        flat = pieces.whole()
    return flat.reshape(shape[::-1]).T if in_columns else flat.reshape(shape)


def write_arrays(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """What `numpy.savez` writes, piece by piece; the same arrays give the same bytes."""
    with zipfile.ZipFile(path, "w") as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                values = np.asanyarray(array)
                if values.nbytes <= LARGE_BYTES or not values.flags.c_contiguous:
                    np.lib.format.write_array(member, values, allow_pickle=False)
                    continue
                np.lib.format.write_array_header_1_0(member, np.lib.format.header_data_from_array_1_0(values))
                for rows in row_blocks(values):
                    member.write(values[rows].tobytes())


def _no_archive(path: Path, what: str, error: BaseException) -> str:
    with open(path, "rb") as file:
        alone = file.read(len(np.lib.format.MAGIC_PREFIX)) == np.lib.format.MAGIC_PREFIX
    if alone:
        return f"{path} is not {what}: it holds one array without a name; save it with numpy.savez(file, frames=…, fps=…)"
    return f"{path} is not {what}, or is damaged ({_reason(error)})"


def _reason(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _header(member: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Shape of an array, whether it lies column by column, and its type."""
    version = np.lib.format.read_magic(member)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    return read(member)


def _view(content: bytes, entry: zipfile.ZipInfo) -> NDArray[Any]:
    """One array where it lies: the local header's two lengths say where its bytes begin, numpy's header what they are."""
    if entry.compress_type != zipfile.ZIP_STORED:
        raise ValueError(f"{entry.filename} is compressed")
    name_bytes, extra_bytes = struct.unpack_from("<HH", content, entry.header_offset + 26)
    start = entry.header_offset + 30 + name_bytes + extra_bytes
    member = io.BytesIO(content[start : start + min(entry.file_size, LARGEST_HEADER_BYTES)])
    shape, in_columns, dtype = _header(member)
    if dtype.hasobject:
        raise ValueError(f"{entry.filename} holds objects")
    flat = np.frombuffer(content, dtype, int(np.prod(shape, dtype=np.int64)), start + member.tell())
    return flat.reshape(shape, order="F" if in_columns else "C")
