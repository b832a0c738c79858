"""Memory is measured in a process of its own, which takes seconds: one test does, the others do without."""

import pytest

from facesynth.evaluation import jobs
from facesynth.methods import registry
from facesynth.methods.capabilities import Capabilities


@pytest.fixture(autouse=True, scope="session")
def no_process_for_memory():
    """`peak_mb` is a number that nobody measured."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(jobs, "peak_speaking_mb", lambda *_: 123.0)
        yield


@pytest.fixture(autouse=True, scope="module")
def toy_methods(request):
    """The methods that a file of tests calls TOYS are known while it runs, and to no other file."""
    toys = getattr(request.module, "TOYS", {})
    for name, cls in toys.items():
        registry.register(Capabilities(name))(cls)
    yield
    for name in toys:
        del registry._CLASSES[name]
