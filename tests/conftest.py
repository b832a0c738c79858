"""What all tests share: where real recordings may lie, and a cache of their own."""

import os
from pathlib import Path

import pytest

RECORDINGS = Path(os.environ.get("FACESYNTH_DATA", Path(__file__).parents[2] / "shared" / "data"))


@pytest.fixture
def recordings():
    """A function that gives the folder of a set of real recordings, or skips where it is absent."""

    def folder(name: str) -> Path:
        path = RECORDINGS / name
        if not path.is_dir():
            pytest.skip(f"real recordings {name!r} are not here; set FACESYNTH_DATA to the folder that holds them")
        return path

    return folder


@pytest.fixture(scope="session")
def repository() -> Path:
    """The checkout: configs, train and export lie beside the package."""
    return Path(__file__).parents[1]
