"""The head and the voice, where they are installed."""

import pytest

from facesynth.inference.errors import FacesynthError


@pytest.fixture(scope="session")
def rig():
    from facesynth.face.rig.arkit_rig import load_head

    try:
        return load_head()
    except FacesynthError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="session")
def lips(rig):
    from facesynth.face.rig.markers import LipGap

    return LipGap.of(rig)


@pytest.fixture(scope="session")
def voice():
    from facesynth.performer.voice import voice_path

    try:
        return voice_path()
    except FacesynthError as error:
        pytest.skip(str(error))
