"""From a file of sound and what is known of it to a `Speech`: the one way in for recorded speech."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import SILENCE
from facesynth.inference.speech import NEUTRAL, EmotionTrack, PhoneTrack, Speech
from facesynth.speech.audio import load_audio, require_sound
from facesynth.speech.emotions import read_emotions
from facesynth.speech.segments import Segment, covering
from facesynth.speech.textgrid import SAME_LENGTH_S, is_textgrid, read_labelled

Source = Literal["textgrid", "labels", "transcript", "recognition"]


@dataclass(frozen=True, eq=False)
class Heard:
    """Speech, and how its phones were found."""

    speech: Speech
    words: tuple[Segment, ...]
    """Word, start and end in seconds; empty where nobody knows the words."""
    warnings: tuple[str, ...]
    source: Source
    """Where the phones come from."""


def hear(
    audio_path: str | Path,
    *,
    text: str | None = None,
    phones_path: str | Path | None = None,
    speaker: str | None = None,
    emotion: str | None = None,
    emotions_path: str | Path | None = None,
    intensity: float = 1.0,
) -> Heard:
    """Read a sound or video file with its phones and emotions; the tracks are exactly as long as the sound.

    Phones come from `phones_path` (a TextGrid, of which those of `speaker` are taken where it holds several, or lines of
    `end label`), else from the transcript `text` by alignment, else by recognition. Emotions come from the track
    `emotions_path`, else are one label for the whole (neutral if none is given) at an intensity from 0 to 1.
    FacesynthError says what cannot be used.
    """
    return hear_sound(
        *load_audio(audio_path),
        text=text,
        phones_path=phones_path,
        speaker=speaker,
        emotion=emotion,
        emotions_path=emotions_path,
        intensity=intensity,
    )


def hear_sound(
    audio: NDArray[np.float32],
    rate: int,
    *,
    text: str | None = None,
    phones_path: str | Path | None = None,
    speaker: str | None = None,
    emotion: str | None = None,
    emotions_path: str | Path | None = None,
    intensity: float = 1.0,
) -> Heard:
    """The same for a sound [S], -1..1, at `rate` Hz."""
    if phones_path is None:
        require_sound(audio, rate)
    duration_s = len(audio) / rate
    emotions = _emotions(emotion, emotions_path, intensity, duration_s)
    phones, words, warnings, source = _phones(audio, rate, text, phones_path, speaker)
    if set(phones.labels) != {SILENCE}:  # who says that nobody speaks may give a sound without any
        require_sound(audio, rate)
    spoken = text if text is not None else " ".join(word for word, _, _ in words)
    return Heard(Speech(audio, rate, phones, emotions, spoken), words, warnings, source)


def _emotions(emotion: str | None, path: str | Path | None, intensity: float, duration_s: float) -> EmotionTrack:
    if path is not None:
        return read_emotions(path, duration_s)
    if not 0 <= intensity <= 1:
        raise FacesynthError(f"intensity must lie from 0 (neutral) to 1 (as recorded); got {intensity:g}")
    return EmotionTrack.constant(emotion or NEUTRAL, duration_s, intensity)


def _phones(
    audio: NDArray[np.float32], rate: int, text: str | None, path: str | Path | None, speaker: str | None
) -> tuple[PhoneTrack, tuple[Segment, ...], tuple[str, ...], Source]:
    duration_s = len(audio) / rate
    if path is not None:
        found = read_labelled(path, duration_s, speaker)
        source: Source = "textgrid" if is_textgrid(path) else "labels"
        remarks = tuple(f"{Path(path).name}: {remark}" for remark in found.remarks)
        return _fitting(found.phones, duration_s, path), _cut(found.words, duration_s), remarks, source
    if text is not None:
        from facesynth.speech.alignment import align

        aligned = align(audio, rate, text)
        return aligned.phones, aligned.words, aligned.warnings, "transcript"
    from facesynth.speech.recognition import recognise

    warning = "nobody gave the words: phones were recognised by ear, up to half of them wrongly; a transcript helps"
    return recognise(audio, rate), (), (warning,), "recognition"


def _fitting(phones: PhoneTrack, duration_s: float, path: str | Path) -> PhoneTrack:
    """The track as long as the sound; FacesynthError where it is another sound's."""
    if phones.duration_s > duration_s + SAME_LENGTH_S:
        raise FacesynthError(
            f"{path} ends at {phones.duration_s:.2f} s, the sound at {duration_s:.2f} s; give the phones of this sound"
        )
    return covering(phones, duration_s)


def _cut(words: tuple[Segment, ...], duration_s: float) -> tuple[Segment, ...]:
    return tuple((word, start_s, min(end_s, duration_s)) for word, start_s, end_s in words if start_s < duration_s)
