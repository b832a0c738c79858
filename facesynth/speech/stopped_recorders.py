"""AIFF, AU, CAF and W64 of a recorder that was stopped short: headers whose sizes were never written are mended in memory.

All but W64 count big-endian. An AIFF is a `FORM` of parts, each a name of four letters, its size and its content, filled up to an
even number of bytes; `COMM` states the number of frames, `SSND` holds them behind 8 bytes. The header of an AU states where the
sound begins and how long it is, 0xFFFFFFFF where that is not known. A CAF is a row of parts with sizes of 64 bits; its `data`
holds 4 bytes and the sound, and a size of -1 says that it goes on to the end. The parts of a W64 are named by 16 bytes, and their
sizes count these and themselves.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from mmap import mmap
from typing import NamedTuple

Content = bytes | mmap
FORM, AU, CAF, W64 = b"FORM", b".snd", b"caff", b"riff"
CAF_FIRST, CAF_BEFORE_SOUND = 8, 4
W64_FIRST, W64_HEAD, W64_ALIGNED = 40, 24, 8
FIRST, BEFORE_SOUND = 12, 8
UNKNOWN = 0xFFFFFFFF
LARGEST_HEADER = 1 << 20
"""Bytes before the sound of an AU; what states more is damaged."""


class _Part(NamedTuple):
    name: bytes
    start: int
    """First byte of the content."""
    size: int


def may_be_mended(head: bytes) -> bool:
    """Whether a file that begins so is of a kind that is known here."""
    return head[:4] in (FORM, AU, CAF, W64)


def mended(content: Content) -> tuple[bytearray, str] | None:
    """The file with its sizes, and what is said of it; None where it needs nothing, or is no such file."""
    if content[:4] == FORM and content[8:12] in (b"AIFF", b"AIFC"):
        return _aiff(content)
    if content[:4] == CAF:
        return _caf(content)
    if content[:4] == W64:
        return _w64(content)
    return _au(content) if content[:4] == AU and len(content) >= 24 else None


def _caf(content: Content) -> tuple[bytearray, str] | None:
    at = CAF_FIRST
    while at + 12 <= len(content):
        name, size = struct.unpack_from(">4sq", content, at)
        start = at + 12
        if name == b"data":
            there = len(content) - start
            if size < 0 or size >= there or (size > CAF_BEFORE_SOUND and _caf_goes_on(content, start + size)):
                return None
            whole = bytearray(content)
            struct.pack_into(">q", whole, at + 4, there)
            return whole, _said(max(0, size - CAF_BEFORE_SOUND), there - CAF_BEFORE_SOUND)
        if size < 0:
            return None
        at = start + size
    return None


def _caf_goes_on(content: Content, at: int) -> bool:
    while at + 12 <= len(content):
        name, size = struct.unpack_from(">4sq", content, at)
        if size < 0 or not all(32 <= letter < 127 for letter in name):
            return False
        at += 12 + size
    return at == len(content)


def _w64(content: Content) -> tuple[bytearray, str] | None:
    at = W64_FIRST
    while at + W64_HEAD <= len(content):
        size = struct.unpack_from("<Q", content, at + W64_HEAD - 8)[0]
        if content[at : at + 4] == b"data":
            there = len(content) - at
            stop = at + -(-size // W64_ALIGNED) * W64_ALIGNED
            if size >= there or (size > W64_HEAD and _w64_goes_on(content, stop)):
                return None
            whole = bytearray(content)
            struct.pack_into("<Q", whole, at + W64_HEAD - 8, there)
            struct.pack_into("<Q", whole, W64_HEAD - 8, len(whole))
            return whole, _said(max(0, size - W64_HEAD), there - W64_HEAD)
        if size < W64_HEAD:
            return None
        at += -(-size // W64_ALIGNED) * W64_ALIGNED
    return None


def _w64_goes_on(content: Content, at: int) -> bool:
    while at + W64_HEAD <= len(content):
        size = struct.unpack_from("<Q", content, at + W64_HEAD - 8)[0]
        if size < W64_HEAD or not all(32 <= letter < 127 for letter in content[at : at + 4]):
            return False
        at += -(-size // W64_ALIGNED) * W64_ALIGNED
    return at >= len(content)


def _aiff(content: Content) -> tuple[bytearray, str] | None:
    parts = list(_parts(content))
    sound = next((part for part in parts if part.name == b"SSND"), None)
    common = next((part for part in parts if part.name == b"COMM"), None)
    if sound is None or common is None or common.size < 18:
        return None
    stop = sound.start + sound.size
    if stop >= len(content) - 1 or _goes_on(content, stop + sound.size % 2):
        return None
    channels, _, bits = struct.unpack_from(">hIh", content, common.start)
    frame_bytes = max(1, channels * -(-bits // 8))
    there = (len(content) - sound.start - BEFORE_SOUND) // frame_bytes * frame_bytes
    stated = max(0, sound.size - BEFORE_SOUND)
    if there <= stated:
        return None
    whole = bytearray(content)
    struct.pack_into(">I", whole, 4, len(whole) - 8)
    struct.pack_into(">I", whole, sound.start - 4, there + BEFORE_SOUND)
    struct.pack_into(">I", whole, common.start + 2, there // frame_bytes)
    return whole, _said(stated, there)


def _parts(content: Content) -> Iterator[_Part]:
    at = FIRST
    while at + 8 <= len(content):
        name, size = struct.unpack_from(">4sI", content, at)
        yield _Part(name, at + 8, size)
        if name == b"SSND" and not _goes_on(content, at + 8 + size + size % 2):
            return
        at += 8 + size + size % 2


def _goes_on(content: Content, at: int) -> bool:
    """Whether parts follow one another from here to the end of the file."""
    while at + 8 <= len(content):
        name, size = struct.unpack_from(">4sI", content, at)
        if not all(32 <= letter < 127 for letter in name):
            return False
        at += 8 + size + size % 2
    return at in (len(content), len(content) + 1)


def _au(content: Content) -> tuple[bytearray, str] | None:
    start, stated = struct.unpack_from(">II", content, 4)
    there = len(content) - start
    if stated == UNKNOWN or not 24 <= start <= LARGEST_HEADER or stated >= there:
        return None
    whole = bytearray(content)
    struct.pack_into(">I", whole, 8, there)
    return whole, _said(stated, there)


def _said(stated: int, there: int) -> str:
    return (
        f"the header states {stated} bytes of sound, as a recorder that was stopped short leaves it;"
        f" all {there} to the end of the file were read"
    )
