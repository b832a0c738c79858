"""The distances between the built-in head's lips."""

import pytest


@pytest.fixture(scope="session")
def lips(rig):
    from facesynth.face.rig.markers import LipGap

    return LipGap.of(rig)
