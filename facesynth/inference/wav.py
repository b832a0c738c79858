"""WAV files of 16 bits a sample, plain or with the extended header that many programs write."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .errors import FacesynthError

PCM, EXTENSIBLE = 1, 0xFFFE


def read_wav(path: Path) -> tuple[NDArray[np.float32], int]:
    """Mono samples [S] (mean of the channels) and their rate."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise FacesynthError(f"{path}: {error.strerror or 'cannot be read'}; wanted a WAV file") from None
    if content[:4] != b"RIFF" or content[8:12] != b"WAVE":
        raise FacesynthError(f"{path} is no WAV file")
    channels, rate = _format(path, _chunk(path, content, b"fmt "))
    data = _chunk(path, content, b"data")
    if len(data) < 2 * channels:
        raise FacesynthError(f"{path} holds no samples; record it again")
    whole = len(data) - len(data) % (2 * channels)
    return np.frombuffer(data[:whole], "<i2").reshape(-1, channels).mean(axis=1).astype(np.float32) / 32768, rate


def _chunk(path: Path, content: bytes, name: bytes) -> bytes:
    at = 12
    while at + 8 <= len(content):
        kind, size = struct.unpack_from("<4sI", content, at)
        if kind == name:
            if at + 8 + size > len(content):
                raise FacesynthError(f"{path} is truncated: {size} bytes are stated, {len(content) - at - 8} are there")
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
