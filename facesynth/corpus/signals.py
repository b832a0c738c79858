"""Sound, phones, emotions and motion of one utterance: from its files and into them."""

import hashlib
from collections.abc import Collection, Sequence
from itertools import chain
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from facesynth.atomic import atomic_path
from facesynth.corpus.files import Files
from facesynth.corpus.header import Header
from facesynth.corpus.npz import read_npz
from facesynth.corpus.record import Record
from facesynth.corpus.utterance import Utterance
from facesynth.inference.errors import FacesynthError
from facesynth.inference.long_arrays import joined, row_blocks
from facesynth.inference.motion import Motion
from facesynth.inference.npz import write_arrays
from facesynth.inference.speech import EmotionTrack, Speech
from facesynth.motion.gaps import LONGEST_S, GapReport, fill_gaps
from facesynth.motion.pose import fill_head
from facesynth.speech.audio import load_audio, save_wav
from facesynth.speech.emotions import read_emotions, write_emotions
from facesynth.speech.segments import Segment
from facesynth.speech.textgrid import read_labelled, write_textgrid

Part = Literal["sound", "phones", "emotions", "motion"]
PARTS: tuple[Part, ...] = ("sound", "phones", "emotions", "motion")
"""What an utterance has files of; emotions only where they move."""


def write_signals(
    files: Files,
    record: Record,
    speech: Speech,
    motion: Motion | None,
    words: Sequence[Segment],
    parts: Collection[Part] = PARTS,
) -> None:
    """Write the files of an utterance, or some of them, each atomically."""
    if "sound" in parts:
        save_wav(files.audio(record.id), speech.audio, speech.sample_rate)
    if "phones" in parts:
        write_textgrid(files.phones(record.id), speech.phones, words)
    if "emotions" in parts:
        _write_emotions(files.emotions(record.id), record, speech.emotions)
    if "motion" in parts and motion is not None:
        write_motion(files.motion(record.id), motion)


def lost_parts(files: Files, utterance_id: str) -> frozenset[Part]:
    """Parts of which the file is not there."""
    paths: dict[Part, Path] = {
        "sound": files.audio(utterance_id),
        "phones": files.phones(utterance_id),
        "motion": files.motion(utterance_id),
    }
    return frozenset(part for part, path in paths.items() if not path.is_file())


def read_utterance(files: Files, header: Header, record: Record) -> tuple[Utterance, GapReport]:
    """An utterance from its files, short gaps filled, with the account of its gaps."""
    speech = read_speech(files, record)
    raw = read_motion(files.motion(record.id), header)
    filled, report = fill_gaps(raw.frames, raw.fps, raw.layout.dimension)
    frames = int(speech.phones.frame_bounds(raw.fps)[-1])
    motion = Motion(
        fit_length(filled, frames, raw.fps),
        raw.fps,
        raw.layout,
        None if raw.head is None else fit_length(fill_head(raw.head, raw.fps), frames, raw.fps),
        None if raw.eyes is None else fit_length(fill_gaps(raw.eyes, raw.fps, 3)[0], frames, raw.fps),
    )
    return Utterance(record.id, speech, motion, record.sentence_key, record.take, header.performer), report


def read_speech(files: Files, record: Record) -> Speech:
    """Sound, phones and emotions of an utterance."""
    audio, rate = load_audio(files.audio(record.id))
    phones = read_labelled(files.phones(record.id), len(audio) / rate).phones
    return Speech(audio, rate, phones, read_emotion_track(files, record, phones.duration_s), record.text)


def read_emotion_track(files: Files, record: Record, duration_s: float) -> EmotionTrack:
    """The utterance's emotions/ID.csv, or where there is none the emotion of its record."""
    path = files.emotions(record.id)
    if not path.exists():
        return EmotionTrack.constant(record.emotion, duration_s, record.intensity)
    return read_emotions(path, duration_s)


def read_motion(path: Path, header: Header) -> Motion:
    """The motion as it was recorded, NaN where samples are missing; FacesynthError for what is no such file."""
    arrays = read_npz(path)
    fps = arrays.get("fps", header.fps)
    if not np.isclose(fps, header.fps, rtol=1e-6):
        raise FacesynthError(f"{path} runs at {fps:g} fps, the corpus at {header.fps:g}; resample it and add it again")
    try:
        return Motion(arrays["frames"], header.fps, header.layout, arrays.get("head"), arrays.get("eyes"))
    except ValueError as error:
        raise FacesynthError(f"{path}: {error}") from None


def write_motion(path: Path, motion: Motion) -> None:
    """Write motion/ID.npz, atomically; the same motion gives the same bytes."""
    arrays: dict[str, Any] = {"frames": motion.frames, "fps": np.float64(motion.fps)}
    arrays |= {name: value for name, value in (("head", motion.head), ("eyes", motion.eyes)) if value is not None}
    with atomic_path(path) as part:
        write_arrays(part, arrays)


def fit_length(signal: NDArray[np.float32], frames: int, fps: float) -> NDArray[np.float32]:
    """Cut a signal [T, C] to `frames`, or lengthen it: the last frame is held for at most 0.1 s, then NaN follows.

    A camera and a microphone seldom stop in the same frame; `check` names differences that are longer.
    """
    lacking = frames - len(signal)
    if lacking <= 0 or not len(signal):
        return signal[:frames]
    held = min(lacking, int(LONGEST_S * fps))
    tail = np.full((lacking, signal.shape[1]), np.nan, np.float32)
    tail[:held] = signal[-1]
    return joined(chain((signal[rows] for rows in row_blocks(signal)), [tail]))


def hash_signals(audio: NDArray[np.float32], sample_rate: int, motion: Motion) -> str:
    """sha256 of the sound and the motion of a recording, whatever is said of it."""
    digest = hashlib.sha256(f"{sample_rate} {motion.fps:.6f}".encode())
    for array in (audio, motion.frames, motion.head, motion.eyes):
        if array is None:
            digest.update(b"none")
            continue
        digest.update(str(array.shape).encode())
        for rows in row_blocks(array):
            digest.update(np.ascontiguousarray(array[rows]).tobytes())
    return digest.hexdigest()


def _write_emotions(path: Path, record: Record, emotions: EmotionTrack) -> None:
    """Write emotions/ID.csv where the record's one emotion does not say it all."""
    if emotions.labels == (record.emotion,) and float(emotions.intensities[0]) == record.intensity:
        path.unlink(missing_ok=True)
    else:
        write_emotions(path, emotions)
