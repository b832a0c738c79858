"""One sentence on the capture stage: said, aligned, acted and recorded in every emotion and take that is wanted."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from facesynth.face.rig.arkit_rig import Rig, load_head
from facesynth.face.rig.markers import LipGap
from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import SILENCE
from facesynth.inference.speech import EmotionTrack, PhoneTrack, Speech
from facesynth.performer.capture import Capture, capture
from facesynth.performer.performance import perform
from facesynth.performer.prosody import Analysis, Voiced, analyse, colour
from facesynth.performer.takes import Take
from facesynth.performer.voice import speak
from facesynth.speech.segments import Segment

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


@dataclass(frozen=True, eq=False)
class Said:
    """A sentence in the calm voice, with its phones; all takes are made of it."""

    calm: Analysis
    phones: PhoneTrack
    words: tuple[Segment, ...]
    unusable: str


def record_takes(takes: Sequence[Take], seed: int, clean: bool) -> list[Recording]:
    """Record takes of one sentence; it is said, taken apart and aligned once, and then coloured for each."""
    said = _say(takes[0].sentence.text)
    return [_record(take, said, seed, clean) for take in takes]


def calm_speech(text: str, before_s: float = PAUSE_S, after_s: float = PAUSE_S) -> Analysis:
    """The voice without emotion, with silence around it, ready to be coloured."""
    audio, rate = speak([text])[0]
    return analyse(np.pad(audio, (round(before_s * rate), round(after_s * rate))), rate)


def _say(text: str) -> Said:
    """Phones and words as our own aligner hears them; a sentence that cannot be aligned stays, marked as unusable."""
    from facesynth.speech.alignment import align

    calm = calm_speech(text)
    try:
        alignment = align(calm.audio, calm.rate, text)
    except FacesynthError as error:
        silence = PhoneTrack((SILENCE,), np.array([len(calm.audio) / calm.rate]))
        return Said(calm, silence, (), f"not aligned: {error}")
    return Said(calm, alignment.phones, tuple(alignment.words), "")


def _record(take: Take, said: Said, seed: int, clean: bool) -> Recording:
    rig, lips = _head()
    voice_seed, acting_seed, recording_seed = take.seeds(seed)
    voiced = colour(said.calm, take.emotion, voice_seed)
    phones, words = _coloured(said, voiced)
    emotions = EmotionTrack.constant(take.emotion, phones.duration_s)
    speech = Speech(voiced.audio, voiced.rate, phones, emotions, take.sentence.text)
    performance = perform(speech, lips, pitch_hz=voiced.pitch_hz, fps=FPS, seed=acting_seed)
    recorded = capture(performance, phones, rig, rng=np.random.default_rng(recording_seed), clean=clean)
    return Recording(take, speech, words, recorded, said.unusable)


def _coloured(said: Said, voiced: Voiced) -> tuple[PhoneTrack, tuple[Segment, ...]]:
    """Phones and words of a take: those of the calm speech, at the times to which its colouring moved them."""
    ends = voiced.when(said.phones.ends_s)
    ends[-1] = voiced.duration_s
    words = tuple((word, *voiced.when((start, end)).tolist()) for word, start, end in said.words)
    return PhoneTrack(said.phones.labels, ends), words


@cache
def _head() -> tuple[Rig, LipGap]:
    rig = load_head()
    return rig, LipGap.of(rig)
