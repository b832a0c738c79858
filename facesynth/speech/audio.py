"""Sound from files: any format, rate and number of channels in, one mono signal out."""

from __future__ import annotations

from collections.abc import Iterator
from errno import EIO
from functools import lru_cache
from io import BytesIO
from math import gcd
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from facesynth.atomic import atomic_path
from facesynth.inference.errors import FacesynthError
from facesynth.inference.sound import KAISER_BETA, REACH
from facesynth.inference.sound import resample as polyphase

if TYPE_CHECKING:
    from av.container import InputContainer
    from torchaudio.transforms import Resample

SHORTEST_S = 0.05
"""Less sound than this holds no phone."""
SILENT_DB = -60.0
"""Level of the loudest 50 ms, in dB of full scale, below which a sound counts as silence."""

CANCELLED = 0.005
"""A mean of channels with less than this share of the loudest one's energy: they undo each other (a cable with swapped poles)."""
LOWEST_HZ = 1000
"""A rate below it is no rate of speech."""
LARGEST_KERNEL = 1 << 20
"""Taps. torchaudio writes each phase of its filter out over a whole period: 160 × 497 taps from 44.1 to 16 kHz, but
16 000 × 44 157 (2.8 GB) from 44 101 Hz. Rates with so little in common take the polyphase filter of the ground floor."""
BLOCK = 1 << 20
"""Samples resampled at once, about."""


def load_audio(path: str | Path) -> tuple[NDArray[np.float32], int]:
    """Read the sound of an audio or video file: mono samples [S] (mean of the channels, -1..1) and their rate in Hz.

    A FacesynthError says whether there is no such file, no sound in it, no sample, or whether it cannot be read.
    """
    path = Path(path)
    if not path.is_file():
        raise FacesynthError(f"{path}: no such file; give a sound or video file")
    if path.stat().st_size == 0:
        raise FacesynthError(f"{path} is empty (0 bytes); export the sound again")
    channels, rate = _read_plain(path) or _read_container(path)
    if channels.shape[0] == 0:
        raise FacesynthError(f"{path} holds 0 samples of sound; record it again")
    audio = _mono(channels)
    if not np.isfinite(audio).all():
        raise FacesynthError(f"{path} holds NaN or infinite samples; export the sound again")
    return audio, rate


def _mono(channels: NDArray[np.float32]) -> NDArray[np.float32]:
    """[S] the mean of channels [S, N]; the loudest one where they cancel."""
    mean = channels.mean(axis=1, dtype=np.float64)
    energies = np.einsum("sn,sn->n", channels, channels, dtype=np.float64)
    if mean @ mean < CANCELLED * energies.max(initial=0):
        return np.array(channels[:, energies.argmax()], np.float32)
    return mean.astype(np.float32)


def resample(audio: NDArray[np.float32], rate: int, new_rate: int) -> NDArray[np.float32]:
    """The same sound [S] at another rate in Hz, band-limited, by the filter that the ground floor's streams have."""
    audio = np.asarray(audio, np.float32)
    if rate == new_rate:
        return audio
    common = gcd(rate, new_rate)
    up, down = new_rate // common, rate // common
    around = -(-REACH * down // min(up, down))
    if up * (down + 2 * around) > LARGEST_KERNEL:
        return polyphase(audio, rate, new_rate)
    return _in_blocks(audio, up, down, around)


def _in_blocks(audio: NDArray[np.float32], up: int, down: int, around: int) -> NDArray[np.float32]:
    """`up` samples for every `down`, in blocks that hold memory down; `around` samples are what the filter reaches."""
    import torch

    convolved = _resampler(up, down)
    size, margin = -(-BLOCK // down) * down, -(-around // down) * down
    parts = []
    for first in range(0, max(1, len(audio)), size):
        begin = max(0, first - margin)
        piece = torch.from_numpy(np.ascontiguousarray(audio[begin : first + size + margin]))
        parts.append(convolved(piece).numpy()[(first - begin) // down * up :][: size // down * up])
    return np.concatenate(parts)


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
            soundfile.write(part, np.clip(audio, -1.0, 1.0), rate, format="WAV", subtype="PCM_16")
        except soundfile.LibsndfileError as error:  # a full disk, a limit on file sizes
            raise OSError(EIO, f"the sound cannot be written ({error})") from error


def as_saved(audio: NDArray[np.float32], rate: int) -> NDArray[np.float32]:
    """What `load_audio` gives back of a mono sound [S] once `save_wav` has written it."""
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
    whole = np.asarray(audio[: len(audio) // block * block], np.float64).reshape(-1, block)
    loudest = float(whole.std(axis=1).max())
    return float(20 * np.log10(loudest)) if loudest > 0 else -np.inf


def _read_plain(path: Path) -> tuple[NDArray[np.float32], int] | None:
    """[S, channels] through libsndfile, or None for a file that it does not know."""
    import soundfile

    try:
        with open(path, "rb") as file:
            samples, rate = soundfile.read(file, dtype="float32", always_2d=True)
    except (soundfile.LibsndfileError, RuntimeError):
        return None
    return samples, int(rate)


def _read_container(path: Path) -> tuple[NDArray[np.float32], int]:
    """[S, channels] of the first sound stream of anything that FFmpeg opens."""
    import av

    try:
        with av.open(str(path)) as container:
            if not container.streams.audio:
                raise FacesynthError(f"{path} has no sound in it; give a file with an audio track")
            rate = int(getattr(container.streams.audio[0], "rate", 0) or 0)
            if rate < LOWEST_HZ:
                raise FacesynthError(f"{path} states a sound of {rate} Hz, or one of a kind that is not known; is it damaged?")
            blocks = list(_decoded(container, rate))
    except FacesynthError:
        raise
    except (av.FFmpegError, ValueError) as error:  # damaged titles are no Unicode, damaged streams no layout that is known
        reason = getattr(error, "strerror", "") or error
        raise FacesynthError(f"{path} cannot be read as sound or video ({reason}); is it damaged?") from None
    return (np.concatenate(blocks) if blocks else np.zeros((0, 1), np.float32)), rate


def _decoded(container: InputContainer, rate: int) -> Iterator[NDArray[np.float32]]:
    import av

    resampler = av.AudioResampler(format="fltp", rate=rate)
    for frame in container.decode(audio=0):
        yield from (block.to_ndarray().T.astype(np.float32) for block in resampler.resample(frame))
    yield from (block.to_ndarray().T.astype(np.float32) for block in resampler.resample(None))
