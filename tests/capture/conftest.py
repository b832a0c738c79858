"""Pictures that can be told apart, and the fetched models where they are here."""

import numpy as np
import pytest

from facesynth.capture.models import MODELS, _kept


@pytest.fixture
def models():
    """Skips where nobody has fetched the networks."""
    if not all(_kept(name).is_file() for name in MODELS):
        pytest.skip("the models are not here; run `facesynth fetch landmarks`")


@pytest.fixture
def pictures():
    """Twelve pictures that grow brighter, so that each can be told from the others."""
    return [np.full((48, 64, 3), 15 * number + 20, np.uint8) for number in range(12)]
