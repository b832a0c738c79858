"""AIFF and AU of a recorder that was stopped short: headers whose sizes were never written are mended in memory.

Both count big-endian. An AIFF is a `FORM` of parts, each a name of four letters, its size and its content, filled up to an even
number of bytes; `COMM` states the number of frames, `SSND` holds them behind 8 bytes. The header of an AU states where the sound
begins and how long it is, 0xFFFFFFFF where that is not known.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from mmap import mmap
from typing import NamedTuple

Content = bytes | mmap
FORM, AU = b"FORM", b".snd"
FIRST, BEFORE_SOUND = 12, 8
UNKNOWN = 0xFFFFFFFF
LARGEST_HEADER = 1 << 20
"""Bytes before the sound of an AU; what states more is damaged."""


class _Part(NamedTuple):
    name: bytes
    start: int
    """First byte of the content."""
    size: int


def mended(content: Content) -> tuple[bytearray, str] | None:
    """The file with its sizes, and what is said of it; None where it needs nothing, or is no such file."""
    if content[:4] == FORM and content[8:12] in (b"AIFF", b"AIFC"):
        return _aiff(content)
    return _au(content) if content[:4] == AU and len(content) >= 24 else None


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
