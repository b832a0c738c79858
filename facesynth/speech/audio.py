"""Sound from files: any format, rate and number of channels in, one mono signal out."""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from errno import EIO
from functools import lru_cache, partial
from io import BytesIO
from math import gcd
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from facesynth.atomic import atomic_path
from facesynth.inference.errors import FacesynthError
from facesynth.inference.long_arrays import Growing, all_finite, by_blocks, let_go, row_blocks
from facesynth.inference.sound import KAISER_BETA, REACH, Resampler
from facesynth.inference.wav import BIG_ENDIAN, FIRST_CHUNK, LONG, LONG_SIZE, find_samples, number_order
from facesynth.packages import is_installed
from facesynth.speech.containers import read_container
from facesynth.speech.one_channel import one_channel
from facesynth.speech.stopped_recorders import may_be_mended, mended

if TYPE_CHECKING:
    from torchaudio.transforms import Resample

SHORTEST_S = 0.05
"""Less sound than this holds no phone."""
SILENT_DB = -60.0
"""Level of the loudest 50 ms, in dB of full scale, below which a sound counts as silence."""

LONG_S = 120.0
"""From here on torchaudio resamples, five times as fast. For less it is not worth its start, which takes two seconds, and
speaking does without torch: the filter of the ground floor is the same one, to 2e-7 of the largest sample."""
LARGEST_KERNEL = 1 << 20
"""Taps. torchaudio writes each phase of its filter out over a whole period: 160 × 497 taps from 44.1 to 16 kHz, but
16 000 × 44 157 (2.8 GB) from 44 101 Hz. Rates with so little in common take the polyphase filter of the ground floor."""
BLOCK = 1 << 20
"""Samples read or resampled at once, about."""
WITH_PACKETS = frozenset({"MPEG", "MP3", "OGG", "FLAC"})
"""Formats of libsndfile's that FFmpeg reads better: by their packets, whatever their headers state, and where pages are lost."""
PACKETED = (b"OggS", b"fLaC", b"ID3", b"\xff\xfb", b"\xff\xf3")
"""How most files of these begin."""


@dataclass(frozen=True, eq=False)
class Recorded:
    """The sound of a file."""

    audio: NDArray[np.float32]
    """[S] the mean of the channels, -1..1; sample 0 lies at 0 s on the clock that the file's pictures have."""
    sample_rate: int
    """Hz."""
    remarks: tuple[str, ...] = ()
    """What was assumed or repaired, a line each."""


def load_audio(path: str | Path) -> tuple[NDArray[np.float32], int]:
    """Samples and rate of `read_sound`, for those who have told what it remarks, or made the file themselves."""
    sound = read_sound(path)
    return sound.audio, sound.sample_rate


def read_sound(path: str | Path) -> Recorded:
    """Read the sound of an audio or video file, mono.

    A FacesynthError says whether there is no such file, no sound in it, no sample, or whether it cannot be read.
    """
    path = Path(path)
    if not path.is_file():
        raise FacesynthError(f"{path}: no such file; give a sound or video file")
    if path.stat().st_size == 0:
        raise FacesynthError(f"{path} is empty (0 bytes); export the sound again")
    sound = _read_plain(path) or Recorded(*read_container(path))
    if not len(sound.audio):
        raise FacesynthError(f"{path} holds 0 samples of sound; record it again")
    if not all_finite(sound.audio):
        raise FacesynthError(f"{path} holds NaN or infinite samples; export the sound again")
    return sound


def resample(audio: NDArray[np.float32], rate: int, new_rate: int) -> NDArray[np.float32]:
    """The same sound [S] at another rate in Hz, band-limited, by the filter that the ground floor's streams have."""
    audio = np.asarray(audio, np.float32)
    if rate == new_rate:
        return audio
    common = gcd(rate, new_rate)
    up, down = new_rate // common, rate // common
    around = -(-REACH * down // min(up, down))
    if len(audio) < LONG_S * rate or up * (down + 2 * around) > LARGEST_KERNEL or not is_installed("torchaudio"):
        return _piece_by_piece(audio, rate, new_rate)
    return _in_blocks(audio, up, down, around)


def _piece_by_piece(audio: NDArray[np.float32], rate: int, new_rate: int) -> NDArray[np.float32]:
    """By the ground floor's filter, which computes in float64: a block at a time holds memory down."""
    resampler = Resampler(rate, new_rate)
    parts = Growing()
    for rows in row_blocks(audio):
        parts.add(resampler.push(audio[rows]))
    return parts.add(resampler.finish()).whole()


def _in_blocks(audio: NDArray[np.float32], up: int, down: int, around: int) -> NDArray[np.float32]:
    """`up` samples for every `down`, in blocks that hold memory down; `around` samples are what the filter reaches."""
    import torch

    convolved = _resampler(up, down)
    size, margin = -(-BLOCK // down) * down, -(-around // down) * down
    parts = Growing()
    for first in range(0, max(1, len(audio)), size):
        begin = max(0, first - margin)
        piece = torch.from_numpy(np.ascontiguousarray(audio[begin : first + size + margin]))
        parts.add(convolved(piece).numpy()[(first - begin) // down * up :][: size // down * up])
        let_go(audio)
    return parts.whole()


@lru_cache(maxsize=8)
def _resampler(up: int, down: int) -> Resample:
    """torchaudio's resampling of integer periods; its filter is brought to a gain of 1 at 0 Hz (it is 1.0007 as it comes).

    The filter is computed in float64: in float32 its places are off by 1e-5.
    """
    import torch
    from torchaudio.transforms import Resample

    method = "sinc_interp_kaiser"
    resampler = Resample(down, up, method, lowpass_filter_width=REACH, rolloff=1.0, beta=KAISER_BETA, dtype=torch.float64)
    resampler.kernel /= resampler.kernel.sum() / up
    return resampler.float()


def save_wav(path: str | Path, audio: NDArray[np.float32], rate: int) -> None:
    """Write mono sound [S], -1..1, as 16-bit WAV; louder samples are clipped. The file appears whole or not at all."""
    import soundfile

    with atomic_path(path) as part:
        try:
            with soundfile.SoundFile(part, "w", rate, 1, "PCM_16", format="WAV") as file:
                for rows in row_blocks(audio):
                    file.write(np.clip(audio[rows], -1.0, 1.0))
        except soundfile.LibsndfileError as error:  # a full disk, a limit on file sizes
            raise OSError(EIO, f"the sound cannot be written ({error})") from error


def as_saved(audio: NDArray[np.float32], rate: int) -> NDArray[np.float32]:
    """What `load_audio` gives back of a mono sound [S] once `save_wav` has written it."""
    return by_blocks(lambda some: _saved(some, rate), audio)


def _saved(audio: NDArray[np.float32], rate: int) -> NDArray[np.float32]:
    import soundfile

    with BytesIO() as file:
        soundfile.write(file, np.clip(audio, -1.0, 1.0), rate, format="WAV", subtype="PCM_16")
        file.seek(0)
        return np.asarray(soundfile.read(file, dtype="float32")[0], np.float32)


def require_sound(audio: NDArray[np.float32], rate: int) -> None:
    """FacesynthError where a sound [S] is too short to hold speech, or silent."""
    duration_s = len(audio) / rate
    if duration_s < SHORTEST_S:
        raise FacesynthError(f"the sound is {duration_s * 1000:.0f} ms long; at least {SHORTEST_S * 1000:.0f} ms are needed")
    level_db = loudest_db(audio, rate)
    if level_db < SILENT_DB:
        raise FacesynthError(
            f"the sound is silent: its loudest 50 ms are at {level_db:.0f} dB of full scale,"
            f" speech lies above {SILENT_DB:.0f} dB; check the microphone or the channel"
        )


def no_speech() -> FacesynthError:
    """What is raised where a sound holds no voice."""
    return FacesynthError("no speech is heard in the sound; give a recording of a voice, or a file of phones")


def loudest_db(audio: NDArray[np.float32], rate: int) -> float:
    """RMS of the loudest 50 ms block around its own mean, dB of full scale; -inf for digital silence."""
    block = max(1, round(SHORTEST_S * rate))
    whole = audio[: len(audio) // block * block].reshape(-1, block)
    loudest = max(float(whole[rows].astype(np.float64).std(axis=1).max()) for rows in row_blocks(whole))
    return float(20 * np.log10(loudest)) if loudest > 0 else -np.inf


def _read_plain(path: Path) -> Recorded | None:
    """A file that libsndfile knows, or None."""
    import soundfile

    try:
        with ExitStack() as opened:
            stored = opened.enter_context(open(path, "rb"))
            if stored.read(FIRST_CHUNK).startswith(PACKETED):
                return None
            stored.seek(0)
            source, remarks = _mended(opened, stored)
            # by its path where it needs no mending: libsndfile seeks before the beginning of damaged files
            with soundfile.SoundFile(path if source is stored else source) as file:
                if file.format in WITH_PACKETS or file.subtype.startswith("MPEG"):
                    return None
                return Recorded(one_channel(partial(_blocks, file)), int(file.samplerate), remarks)
    except (soundfile.LibsndfileError, RuntimeError):
        return None


def _blocks(file: Any) -> Iterator[NDArray[np.float32]]:
    """All of a file's sound [n, channels], from its beginning."""
    file.seek(0)
    yield from file.blocks(BLOCK, dtype="float32", always_2d=True)


def _mended(opened: ExitStack, stored: BinaryIO) -> tuple[BinaryIO, tuple[str, ...]]:
    """The file, its header mended in memory where a recorder never wrote the size of the sound; and what was noticed."""
    head = stored.read(FIRST_CHUNK)
    stored.seek(0)
    if may_be_mended(head):
        whole = mended(opened.enter_context(mmap.mmap(stored.fileno(), 0, access=mmap.ACCESS_READ)))
        return (stored, ()) if whole is None else (BytesIO(whole[0]), (whole[1],))
    if head[:4] not in (b"RIFF", BIG_ENDIAN, *LONG) or head[8:] != b"WAVE":
        return stored, ()
    content = opened.enter_context(mmap.mmap(stored.fileno(), 0, access=mmap.ACCESS_READ))
    found = find_samples(content)
    if found is None or not found.remark:
        return stored, ()
    if found.cut_off and head[:4] not in LONG:
        return stored, (found.remark,)
    sized = bytearray(content)
    if head[:4] in LONG:
        sized[:4] = b"RF64"  # libsndfile knows it by this name
        struct.pack_into("<Q", sized, LONG_SIZE, found.stop - found.start)
        struct.pack_into("<I", sized, found.start - 4, 0xFFFFFFFF)
    else:
        order = number_order(content)
        struct.pack_into(f"{order}I", sized, found.start - 4, found.stop - found.start)
        struct.pack_into(f"{order}I", sized, 4, len(sized) - 8)
    return BytesIO(sized), (found.remark,)
