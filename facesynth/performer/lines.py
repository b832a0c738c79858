"""New speech in the performer's voice: lines that are not in the script, each with its own feeling."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.errors import FacesynthError
from facesynth.inference.speech import EmotionTrack
from facesynth.performer.prosody import colour
from facesynth.performer.stage import PAUSE_S, calm_speech
from facesynth.performer.voice import speak

BETWEEN_S = 0.12
"""Silence at each side of a joint between two lines: a breath, not a stop."""

DEMO_LINES: tuple[tuple[str, str], ...] = (
    ("I was so happy when you promised to bring my brother home for the weekend,", "happy"),
    ("but then you forgot about us, and nobody even bothered to call me before five,", "angry"),
    ("and now the big house is quiet, and I have no idea what to tell my mother.", "sad"),
)
"""One sentence that goes through three emotions; none of it is in the script."""


@dataclass(frozen=True, eq=False)
class SpokenLines:
    """Lines as they were said, one after the other."""

    audio: NDArray[np.float32]
    """[S] mono, -1..1."""
    rate: int
    """Hz."""
    text: str
    emotions: EmotionTrack
    """Which feeling holds until when."""


def speak_lines(lines: Sequence[tuple[str, str]], *, seed: int = 0) -> SpokenLines:
    """Say (text, emotion) pairs as one utterance; the same seed gives the same samples."""
    if not lines:
        raise FacesynthError("there are no lines to speak; give at least one (text, emotion)")
    speak([text for text, _ in lines])
    last = len(lines) - 1
    parts: list[NDArray[np.float32]] = []
    for number, (text, emotion) in enumerate(lines):
        calm = calm_speech(text, BETWEEN_S if number else PAUSE_S, BETWEEN_S if number < last else PAUSE_S)
        parts.append(colour(calm, emotion, seed * 1009 + number).audio)
    rate = calm.rate
    ends_s = np.cumsum([len(part) for part in parts]) / rate
    emotions = EmotionTrack(tuple(emotion for _, emotion in lines), ends_s, np.ones(len(lines)))
    return SpokenLines(np.concatenate(parts), rate, " ".join(text for text, _ in lines), emotions)
