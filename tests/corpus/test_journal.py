import os

import numpy as np
import pytest
from corpora import tiny_corpus

from facesynth.corpus import Corpus, node_name, parse_node
from facesynth.inference.errors import FacesynthError


@pytest.fixture
def corpus(tmp_path):
    return tiny_corpus(tmp_path / "tiny", 2)


def test_removing_and_undoing(corpus):
    corpus.remove_node("s00_happy_t1:3")
    corpus.remove_node("s00_happy_t1:4")
    assert Corpus.open(corpus.path).removed_nodes() == {"s00_happy_t1:3", "s00_happy_t1:4"}
    assert corpus.undo().facts["node"] == "s00_happy_t1:4"
    assert corpus.removed_nodes() == {"s00_happy_t1:3"}
    corpus.undo()
    assert corpus.removed_nodes() == frozenset()
    with pytest.raises(FacesynthError, match="nothing to undo"):
        corpus.undo()
    assert len(corpus.journal.edits) == 4, "the journal only grows"


def test_adding_a_node_keeps_its_frames_and_its_name(corpus):
    frames = np.random.default_rng(0).normal(0, 30, (7, 42)).astype(np.float32)
    corpus.remove_node("s00_happy_t1:3")
    node = corpus.add_node("aa", "sad", frames)
    (kept,) = Corpus.open(corpus.path).added_nodes()
    assert (kept.name, kept.phone, kept.emotion) == (node.name, "aa", "sad")
    np.testing.assert_allclose(kept.frames, frames, atol=1e-4)
    assert parse_node(node.name) == ("+", 2)
    corpus.remove_node(node.name)
    assert corpus.added_nodes() == ()
    corpus.undo()
    assert [n.name for n in corpus.added_nodes()] == [node.name]
    assert corpus.add_node("aa", "sad", frames).name != node.name


def test_removing_again_says_nothing_new(corpus):
    corpus.remove_node("s00_happy_t1:3")
    corpus.remove_node("s00_happy_t1:03")
    assert len(corpus.journal.edits) == 1


@pytest.mark.parametrize(
    "name", ["s00_happy_t1:999", "nobody:1", "s00_happy_t1", "s00_happy_t1:-1", "+:1", ":1", "s00_happy_t1:²"]
)
def test_a_node_that_does_not_exist_is_refused(corpus, name):
    with pytest.raises(FacesynthError):
        corpus.remove_node(name)
    assert not corpus.files.journal.exists()


@pytest.mark.parametrize(
    ("phone", "emotion", "frames"),
    [
        ("xx", "sad", np.zeros((3, 42))),
        ("aa", "angy", np.zeros((3, 42))),
        ("aa", "sad", np.zeros((3, 41))),
        ("aa", "sad", np.zeros((0, 42))),
        ("aa", "sad", np.full((3, 42), np.nan)),
    ],
)
def test_a_node_that_does_not_fit_is_refused(corpus, phone, emotion, frames):
    with pytest.raises(FacesynthError):
        corpus.add_node(phone, emotion, frames)
    assert not corpus.files.journal.exists()


def test_an_interrupted_edit_leaves_the_journal_as_it_was(corpus, monkeypatch):
    corpus.remove_node("s00_happy_t1:3")

    def failing(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", failing)
    with pytest.raises(KeyboardInterrupt):
        corpus.remove_node("s00_happy_t1:4")
    assert corpus.removed_nodes() == {"s00_happy_t1:3"}


@pytest.mark.parametrize(
    "line", ["{", "[]", '{"op": "burn"}', '{"op": "remove"}', '{"op": "remove", "node": 3}', '{"op": "undo", "of": "x"}']
)
def test_a_damaged_line_is_named(corpus, line):
    corpus.remove_node("s00_happy_t1:3")
    with open(corpus.files.journal, "a", encoding="utf-8") as file:
        file.write(line + "\n")
    with pytest.raises(FacesynthError, match="line 2"):
        corpus.removed_nodes()


def test_names():
    assert parse_node(node_name("Übung 7", 12)) == ("Übung 7", 12)
