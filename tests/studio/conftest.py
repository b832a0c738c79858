"""One browser and one studio for all tests that look at the page."""

import pytest
from browsing import Page, browser, started
from corpora import tiny_corpus

from facesynth.methods.efase.method import Efase


@pytest.fixture(scope="session")
def chromium():
    """A browser; each test opens windows of its own in it."""
    with browser() as launched:
        yield launched


@pytest.fixture(scope="session")
def shop(tmp_path_factory, rig):
    """A corpus and a model in a folder with a difficult name."""
    folder = tmp_path_factory.mktemp("Büro mit Ümläuten")
    corpus = tiny_corpus(folder / "actor", utterances=16, fps=60)
    Efase().fit(corpus).save(folder / "model.safetensors")
    return folder


@pytest.fixture(scope="session")
def studio(shop):
    """The address of a studio that works in shop / "work"."""
    with started(shop / "actor", shop / "model.safetensors", "--project", shop / "work") as address:
        yield address


@pytest.fixture
def window(chromium, studio):
    """A function that opens a window of the studio; what its console said is looked at afterwards."""
    opened = []

    def open_window(**context):
        opened.append(Page(chromium, studio, **context))
        return opened[-1]

    yield open_window
    for page in opened:
        page.context.close()
        assert page.errors == []
