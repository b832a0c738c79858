import bringing
import numpy as np
import pytest


@pytest.fixture(scope="session")
def talker(tmp_path_factory):
    return bringing.talker(tmp_path_factory.mktemp("talker"))


@pytest.fixture(scope="session")
def voiced(voice, tmp_path_factory):
    """A sound of clear speech, with its words."""
    from facesynth.performer.voice import speak

    text = "The boat moved up and down."
    audio, rate = speak([text])[0]
    audio = np.pad(audio, (rate // 5, rate // 5))
    return bringing.Voiced.of(tmp_path_factory.mktemp("voiced") / "voiced.wav", text, audio, rate)
