"""One sentence on the capture stage: said, aligned, acted and recorded in every emotion and take that is wanted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from facesynth.errors import FacesynthError
from facesynth.face.markers import LipGap
from facesynth.face.rig import Rig, load_head
from facesynth.performer.capture import Capture, capture
from facesynth.performer.performance import perform
from facesynth.performer.prosody import Analysis, Voiced, analyse, colour
from facesynth.performer.takes import Take
from facesynth.performer.voice import speak
from facesynth.speech.phones import SILENCE
from facesynth.speech.segments import Segment
from facesynth.speech.speech import EmotionTrack, PhoneTrack, Speech

FPS = 120.0
PAUSE_S = 0.35
"""Silence before and after an utterance."""


@dataclass(frozen=True, eq=False)
class Recording:
    """A take with everything that was recorded of it."""

    take: Take
    speech: Speech
    words: tuple[Segment, ...]
    capture: Capture
    unusable: str
    """Why it cannot be used; empty if it can."""


def record_takes(takes: Sequence[Take], seed: int, clean: bool) -> list[Recording]:
    """Record takes of one sentence; it is said and taken apart once, and then coloured for each."""
    calm = calm_speech(takes[0].sentence.text)
    return [_record(take, calm, seed, clean) for take in takes]


def calm_speech(text: str, before_s: float = PAUSE_S, after_s: float = PAUSE_S) -> Analysis:
    """The voice without emotion, with silence around it, ready to be coloured."""
    audio, rate = speak([text])[0]
    return analyse(np.pad(audio, (round(before_s * rate), round(after_s * rate))), rate)


def _record(take: Take, calm: Analysis, seed: int, clean: bool) -> Recording:
    rig, lips = _head()
    voice_seed, acting_seed, recording_seed = take.seeds(seed)
    voiced = colour(calm, take.emotion, voice_seed)
    phones, words, unusable = _aligned(voiced, take.sentence.text)
    emotions = EmotionTrack.constant(take.emotion, phones.duration_s)
    speech = Speech(voiced.audio, voiced.rate, phones, emotions, take.sentence.text)
    performance = perform(speech, lips, pitch_hz=voiced.pitch_hz, fps=FPS, seed=acting_seed)
    recorded = capture(performance, phones, rig, rng=np.random.default_rng(recording_seed), clean=clean)
    return Recording(take, speech, words, recorded, unusable)


def _aligned(voiced: Voiced, text: str) -> tuple[PhoneTrack, tuple[Segment, ...], str]:
    """Phones and words as our own aligner hears them; a take that cannot be aligned stays, marked as unusable."""
    from facesynth.speech.alignment import align

    try:
        alignment = align(voiced.audio, voiced.rate, text)
    except FacesynthError as error:
        silence = PhoneTrack((SILENCE,), _ends(len(voiced.audio) / voiced.rate))
        return silence, (), f"not aligned: {error}"
    return alignment.phones, tuple(alignment.words), ""


def _ends(*ends_s: float) -> NDArray[np.float64]:
    return np.array(ends_s, np.float64)


@cache
def _head() -> tuple[Rig, LipGap]:
    rig = load_head()
    return rig, LipGap.of(rig)
