"""From a file of sound and what is known of it to a `Speech`: the one way in for recorded speech."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import SILENCE
from facesynth.inference.speech import NEUTRAL, EmotionTrack, Speech
from facesynth.speech.audio import read_sound, require_sound
from facesynth.speech.emotions import read_emotions
from facesynth.speech.phone_sources import Sought, Source, find_phones
from facesynth.speech.segments import Segment


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
    language: str | None = None,
    transcriber: Path | None = None,
    emotion: str | None = None,
    emotions_path: str | Path | None = None,
    intensity: float = 1.0,
    sought: Sought = "placed",
) -> Heard:
    """Read a sound or video file with its phones and emotions; the tracks are exactly as long as the sound.

    Phones are found as `find_phones` does it, `phones_path` being those that are given. Emotions come from the track
    `emotions_path`, else are one label for the whole (neutral if none is given) at an intensity from 0 to 1.
    FacesynthError says what cannot be used.
    """
    sound = read_sound(audio_path)
    heard = hear_sound(
        sound.audio,
        sound.sample_rate,
        text=text,
        phones_path=phones_path,
        speaker=speaker,
        language=language,
        transcriber=transcriber,
        emotion=emotion,
        emotions_path=emotions_path,
        intensity=intensity,
        sought=sought,
    )
    return replace(heard, warnings=(*sound.remarks, *heard.warnings))


def hear_sound(
    audio: NDArray[np.float32],
    rate: int,
    *,
    text: str | None = None,
    phones_path: str | Path | None = None,
    speaker: str | None = None,
    language: str | None = None,
    transcriber: Path | None = None,
    emotion: str | None = None,
    emotions_path: str | Path | None = None,
    intensity: float = 1.0,
    sought: Sought = "placed",
) -> Heard:
    """The same for a sound [S], -1..1, at `rate` Hz."""
    if phones_path is None:
        require_sound(audio, rate)
    emotions = _emotions(emotion, emotions_path, intensity, len(audio) / rate)
    found = find_phones(
        audio,
        rate,
        given=phones_path,
        speaker=speaker,
        text=text,
        language=language,
        transcriber=transcriber,
        sought=sought,
    )
    if set(found.phones.labels) != {SILENCE}:  # who says that nobody speaks may give a sound without any
        require_sound(audio, rate)
    spoken = text if text is not None else found.text or " ".join(word for word, _, _ in found.words)
    return Heard(Speech(audio, rate, found.phones, emotions, spoken), found.words, found.remarks, found.source)


def _emotions(emotion: str | None, path: str | Path | None, intensity: float, duration_s: float) -> EmotionTrack:
    if path is not None:
        return read_emotions(path, duration_s)
    if not 0 <= intensity <= 1:
        raise FacesynthError(f"intensity must lie from 0 (neutral) to 1 (as recorded); got {intensity:g}")
    return EmotionTrack.constant(emotion or NEUTRAL, duration_s, intensity)
