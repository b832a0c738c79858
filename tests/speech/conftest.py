"""A voice for tests of alignment and recognition where there are no recordings."""

from functools import cache

import numpy as np
import pytest

FOX = "The quick brown fox jumps over the lazy dog."


@cache
def _say(text):
    from facesynth.performer.voice import speak

    audio, rate = speak([text])[0]
    return np.pad(audio, (rate // 5, rate // 5)), rate


@pytest.fixture(scope="session")
def say(voice):
    """A function from a text to (audio, rate) of the built-in performer's voice, with 0.2 s of silence around it."""
    return _say
