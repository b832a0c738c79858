"""WAV files of 16 bits a sample, plain or with the extended header that many programs write."""

import mmap
import struct
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .errors import FacesynthError

PCM, EXTENSIBLE = 1, 0xFFFE
LONG = (b"RF64", b"BW64")
"""First bytes of WAV files that may be longer than 4 GB; a part `ds64` of theirs states the size of the sound."""
BIG_ENDIAN = b"RIFX"
"""First bytes of WAV files whose numbers begin with their highest byte."""
LONG_SIZE = 28
"""Byte at which it does."""
FIRST_CHUNK = 12
"""Byte at which the first part of the file begins."""
NOTES = (b"LIST", b"bext", b"iXML", b"id3 ", b"ID3 ", b"cue ")
"""Parts in which recorders keep titles and the like, some behind the sound."""
LARGEST_NOTES = 1 << 20
LARGEST_PADDING = 1 << 16
"""Zeros behind the sound that fill up a block of a disk."""


def read_wav(path: Path) -> tuple[NDArray[np.float32], int]:
    """Mono samples [S] (mean of the channels) and their rate."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise FacesynthError(f"{path}: {error.strerror or 'cannot be read'}; wanted a WAV file") from None
    if content[:4] != b"RIFF" or content[8:12] != b"WAVE":
        raise FacesynthError(f"{path} is no WAV file")
    channels, rate = _format(path, _chunk(path, content, b"fmt "))
    found = find_samples(content)
    if found is None:
        raise FacesynthError(f"{path} has no part 'data': it is truncated or no WAV file")
    if found.cut_off:
        raise FacesynthError(f"{path} is truncated: {found.stated} bytes are stated, {found.stop - found.start} are there")
    if found.remark:
        warnings.warn(f"{path}: {found.remark}", stacklevel=2)
    data = content[found.start : found.stop]
    if len(data) < 2 * channels:
        raise FacesynthError(f"{path} holds no samples; record it again")
    whole = len(data) - len(data) % (2 * channels)
    return np.frombuffer(data[:whole], "<i2").reshape(-1, channels).mean(axis=1).astype(np.float32) / 32768, rate


@dataclass(frozen=True)
class Samples:
    """Where the samples of a WAV file lie."""

    start: int
    """First byte."""
    stop: int
    """Byte after the last."""
    stated: int
    """Bytes that the header states."""

    @property
    def cut_off(self) -> bool:
        """Whether the file states more than it holds."""
        return self.stated > self.stop - self.start

    @property
    def remark(self) -> str:
        """What a person should know of it; empty where the header is right."""
        if self.stated == self.stop - self.start:
            return ""
        if self.cut_off:
            return f"the header states {self.stated} bytes of sound, {self.stop - self.start} are there: the file is cut off"
        return (
            f"the header states {self.stated} bytes of sound, as a recorder that was stopped short leaves it;"
            f" all {self.stop - self.start} to the end of the file were read"
        )


def find_samples(content: bytes | mmap.mmap) -> Samples | None:
    """Where the samples lie: to the end of the file where a recorder never wrote their size; None where there are none."""
    at, order = FIRST_CHUNK, number_order(content)
    while at + 8 <= len(content):
        kind, size = struct.unpack_from(f"{order}4sI", content, at)
        start = at + 8
        if kind == b"data":
            size = _long_size(content, size)
            stop = start + size
            # the byte that makes a size even is not written by all
            whole = any(_ends_at(content, place, order) for place in {stop + size % 2, stop})
            return Samples(start, min(stop, len(content)) if whole else _before_notes(content, start, order), size)
        at = start + size + size % 2
    return None


def number_order(content: bytes | mmap.mmap) -> str:
    """How `struct` reads the numbers of a WAV file."""
    return ">" if content[:4] == BIG_ENDIAN else "<"


def _long_size(content: bytes | mmap.mmap, size: int) -> int:
    """Bytes of sound that a file states, where 32 bits may not hold them."""
    in_ds64 = size == 0xFFFFFFFF and content[:4] in LONG and content[FIRST_CHUNK : FIRST_CHUNK + 4] == b"ds64"
    return struct.unpack_from("<Q", content, LONG_SIZE)[0] if in_ds64 else size


def _before_notes(content: bytes | mmap.mmap, start: int, order: str) -> int:
    """The byte at which the sound ends: where a recorder's notes follow up to the end of the file, before these."""
    places = (content.find(name, max(start, len(content) - LARGEST_NOTES)) for name in NOTES)
    return min((at for at in places if at >= 0 and _ends_at(content, at, order)), default=len(content))


def _ends_at(content: bytes | mmap.mmap, at: int, order: str) -> bool:
    """Whether other parts of a WAV file follow, or padding, and not sound that belongs to the part before."""
    if at < len(content) <= at + LARGEST_PADDING and not any(content[at:]):
        return True
    while at + 8 <= len(content):
        kind, size = struct.unpack_from(f"{order}4sI", content, at)
        if not all(32 <= letter < 127 for letter in kind) or at + 8 + size > len(content) + 1:
            return False
        at += 8 + size + size % 2
    return True


def _chunk(path: Path, content: bytes, name: bytes) -> bytes:
    at = FIRST_CHUNK
    while at + 8 <= len(content):
        kind, size = struct.unpack_from("<4sI", content, at)
        if kind == name:
            return content[at + 8 : at + 8 + size]
        at += 8 + size + size % 2
    raise FacesynthError(f"{path} has no part {name.decode()!r}: it is truncated or no WAV file")


def _format(path: Path, chunk: bytes) -> tuple[int, int]:
    """Channels and rate."""
    if len(chunk) < 16:
        raise FacesynthError(f"{path} has a damaged header")
    kind, channels, rate, _, _, bits = struct.unpack_from("<HHIIHH", chunk)
    if kind == EXTENSIBLE and len(chunk) >= 26:
        kind = struct.unpack_from("<H", chunk, 24)[0]
    if kind != PCM or bits != 16:
        raise FacesynthError(f"{path} has {bits} bits a sample in coding {kind}; wanted whole numbers of 16 bits")
    if not channels or not rate:
        raise FacesynthError(f"{path} states {channels} channels at {rate} Hz")
    return channels, rate
