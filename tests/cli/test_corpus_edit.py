"""Removing, restoring, drawing and undoing nodes from the command line; what would change nothing is refused."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from corpora import tiny_corpus

from facesynth.cli.corpus import corpus_group
from facesynth.corpus import Corpus
from facesynth.corpus.signals import write_motion
from facesynth.inference.errors import FacesynthError
from facesynth.methods.registry import create


def run(*arguments):
    result = CliRunner().invoke(corpus_group, ["edit", *map(str, arguments)])
    if isinstance(result.exception, FacesynthError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.stdout


@pytest.fixture
def corpus(tmp_path):
    return tiny_corpus(tmp_path / "actör", 6, fps=60)


def test_nodes_are_removed_restored_and_undone(corpus):
    first, second = f"{corpus.ids[0]}:3", f"{corpus.ids[1]}:2"
    assert json.loads(run("remove", corpus.path, first, second, first, "--json"))["removed"] == [first, second]
    run("restore", corpus.path, first)
    assert corpus.removed_nodes() == {second}
    listed = json.loads(run("list", corpus.path, "--json"))
    assert [one["op"] for one in listed["edits"]] == ["remove", "remove", "restore"]
    assert listed["removed"] == [second]
    assert "undone: restore" in run("undo", corpus.path)
    assert corpus.removed_nodes() == {first, second}
    assert "(undone)" in run("list", corpus.path)
    for _ in range(2):
        run("undo", corpus.path)
    assert corpus.removed_nodes() == frozenset()
    with pytest.raises(FacesynthError, match="nothing to undo"):
        run("undo", corpus.path)


def test_what_would_change_nothing_changes_nothing(corpus):
    name = f"{corpus.ids[0]}:3"
    run("remove", corpus.path, name)
    before = corpus.files.journal.read_bytes()
    for verb, nodes, said in (
        ("remove", [f"{corpus.ids[1]}:2", name], "removed already"),
        ("remove", [f"{corpus.ids[1]}:2", "nobody:3"], "nobody"),
        ("restore", [name, f"{corpus.ids[1]}:2"], "not removed"),
        ("restore", [f"{corpus.ids[1]}:99"], "99"),
    ):
        with pytest.raises(FacesynthError, match=said):
            run(verb, corpus.path, *nodes)
    assert corpus.files.journal.read_bytes() == before


def test_a_node_is_drawn_on_the_map_and_learned_like_a_recorded_one(corpus, tmp_path):
    model = create("efase").fit(corpus)
    model.save(tmp_path / "model.safetensors")
    found = model.phone_map("p")
    path = tmp_path / "path.csv"
    ends = found.plane.points[[0, len(found.plane.points) // 2]]
    path.write_text("x,y\n" + "\n".join(f"{x},{y}" for x, y in ends))
    drawn = ("--model", tmp_path / "model.safetensors", "--path", path, "--seconds", 0.15)
    said = json.loads(run("add", corpus.path, "--phone", "p", "--emotion", "sad", "--title", "weit", *drawn, "--json"))
    assert (said["node"], said["frames"], said["title"]) == ("+:1", 9, "weit")
    trained = create("efase").fit(Corpus.open(corpus.path))
    assert "+:1" in trained.facts["names"]
    assert trained.provenance["drawn_nodes"] == 1
    assert trained.provenance["removed_nodes"] == 0
    speech = next(iter(corpus)).speech
    at = speech.phones.labels.index("p") if "p" in speech.phones.labels else 1
    assert trained.explain(speech, constraints={at: "+:1"})[at]["node"] == "+:1"
    with pytest.raises(FacesynthError, match="this node already"):
        run("add", corpus.path, "--phone", "p", "--emotion", "sad", *drawn)
    run("remove", corpus.path, "+:1")
    assert corpus.added_nodes() == ()
    run("restore", corpus.path, "+:1")
    assert [node.title for node in corpus.added_nodes()] == ["weit"]


def test_a_node_is_added_from_a_file(corpus, tmp_path):
    recorded = next(iter(corpus)).motion.frames[:20]
    np.savez(tmp_path / "node.npz", frames=recorded, fps=120.0)
    said = json.loads(run("add", corpus.path, "--phone", "aa", "--emotion", "happy", "--motion", tmp_path / "node.npz", "--json"))
    assert said["frames"] == 10
    np.savez(tmp_path / "odd.npz", frames=recorded[:, :40])
    path = tmp_path / "path.csv"
    path.write_text("x,y\n1,2,3\n")
    for given, wanted in (
        (["--motion", tmp_path / "odd.npz"], "42"),
        (["--motion", tmp_path / "none.npz"], "none.npz"),
        (["--path", path, "--seconds", 1], "together"),
        ([], "together"),
    ):
        with pytest.raises(FacesynthError, match=wanted):
            run("add", corpus.path, "--phone", "aa", "--emotion", "sad", *given)
    for what in (["--phone", "pau", "--emotion", "sad"], ["--phone", "aa", "--emotion", "glad"]):
        with pytest.raises(FacesynthError, match="unknown"):
            run("add", corpus.path, *what, "--motion", tmp_path / "node.npz")


def test_a_contaminated_node_is_the_first_suspect(corpus, tmp_path):
    model = create("efase").fit(corpus)
    model.save(tmp_path / "clean.safetensors")
    before = json.loads(run("suspects", corpus.path, "--model", tmp_path / "clean.safetensors", "--json"))
    utterance = corpus[corpus.ids[2]]
    frames, bounds = utterance.motion.frames.copy(), utterance.speech.phones.frame_bounds(60)
    frames[bounds[4] + 2 : bounds[5] - 1, 27:30] += 40
    spoiled = type(utterance.motion)(frames, 60.0, corpus.layout, utterance.motion.head, utterance.motion.eyes)
    write_motion(corpus.files.motion(corpus.ids[2]), spoiled)
    assert f"{corpus.ids[2]}:4" not in [one["node"] for one in before["suspects"]]
    for given in ((), ("--model", tmp_path / "clean.safetensors")):
        (first, *_) = json.loads(run("suspects", corpus.path, *given, "--json"))["suspects"]
        assert first["node"] == f"{corpus.ids[2]}:4"
        assert "jumps" in first["reasons"][0] or len(first["reasons"]) > 1
    run("remove", corpus.path, f"{corpus.ids[2]}:4")
    left = json.loads(run("suspects", corpus.path, "--json"))["suspects"]
    assert f"{corpus.ids[2]}:4" not in [one["node"] for one in left]
