"""Pictures that can be told apart."""

import numpy as np
import pytest


@pytest.fixture
def pictures():
    """Twelve pictures that grow brighter, so that each can be told from the others."""
    return [np.full((48, 64, 3), 15 * number + 20, np.uint8) for number in range(12)]
