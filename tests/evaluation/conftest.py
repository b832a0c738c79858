"""What takes seconds each time is done without: memory measured in a process of its own, judges that learn what is in step.

The files of those try them; the command line's tests have both.
"""

import pytest

from facesynth.evaluation import compare, jobs, judge
from facesynth.methods import registry
from facesynth.methods.capabilities import Capabilities


@pytest.fixture(autouse=True, scope="session")
def no_process_for_memory():
    """`peak_mb` is a number that nobody measured."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(jobs, "peak_speaking_mb", lambda *_: 123.0)
        yield


@pytest.fixture(autouse=True, scope="session")
def no_judges_that_learn():
    """Nothing is said of lips in step."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compare, "sync_of", lambda train: None)
        patch.setattr(judge, "sync_of", lambda train: None)
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
