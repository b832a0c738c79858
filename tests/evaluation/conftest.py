"""Memory is measured in a process of its own, which takes seconds: one test does, the others do without."""

import pytest

from facesynth.evaluation import jobs


@pytest.fixture(autouse=True, scope="session")
def no_process_for_memory():
    """`peak_mb` is a number that nobody measured."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(jobs, "peak_speaking_mb", lambda *_: 123.0)
        yield
