"""Nodes that are taken from a trained model, or drawn into it: as if it had been trained so, without training."""

import json
from dataclasses import replace

import numpy as np
import pytest
from corpora import tiny_corpus
from literal_search import literal
from test_efase_search import random_nodes, random_query

from facesynth.corpus.journal import Journal
from facesynth.inference.efase.bounds import step_bounds
from facesynth.inference.efase.changed_bounds import changed_bounds
from facesynth.inference.efase.costs import Weights, all_targets
from facesynth.inference.efase.nodes import Nodes
from facesynth.inference.efase.search import SearchIndex
from facesynth.inference.errors import FacesynthError
from facesynth.inference.speech import PhoneTrack
from facesynth.methods.efase.method import Efase
from facesynth.methods.learn import expectation as prediction
from facesynth.methods.registry import load, read_option


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("edits") / "corpus", utterances=14, fps=60)


@pytest.fixture(scope="module")
def model(corpus):
    return Efase().fit(corpus)


@pytest.fixture
def journal(tmp_path):
    return Journal(tmp_path / "edits.jsonl")


def drawn_like(corpus, name, rng):
    """The frames of a recorded node, a little otherwise."""
    utterance, number = name.rpartition(":")[0], int(name.rpartition(":")[2])
    recorded = corpus[utterance]
    bounds = recorded.speech.phones.frame_bounds(60)
    return recorded.motion.frames[bounds[number] : bounds[number + 1]] + rng.normal(0, 0.1, 42).astype(np.float32)


@pytest.mark.parametrize("pnt", [0.5, 20.0])
def test_changed_bounds_keep_the_search_exact(pnt):
    rng = np.random.default_rng(int(pnt))
    for _ in range(8):
        old, weights = random_nodes(rng, 34), Weights(pnt)
        kept = np.flatnonzero(rng.random(34) < rng.uniform(0.5, 1.0))
        left, extra = old.take(kept), random_nodes(rng, 5, phones=6, sentence=1)
        frames, shift = np.concatenate([old.frames, extra.frames]), len(old.frames)
        columns = {n: np.concatenate([getattr(left, n), getattr(extra, n)]) for n in ("phones", "visemes", "emotions", "before")}
        ends = {n: np.concatenate([getattr(left, n), getattr(extra, n) + shift]) for n in ("starts", "stops")}
        new = Nodes(frames, **columns, **ends)
        index = SearchIndex(new, weights, changed_bounds(old, step_bounds(old, weights), kept, new, weights))
        for _ in range(3):
            query = random_query(rng, new, 9)
            np.testing.assert_array_equal(index.cheapest_path(all_targets(new, query, weights)), literal(new, query, weights)[1])


def test_removing_is_as_training_without(corpus, model, journal, tmp_path):
    names = model.facts["names"]
    gone = [names[k] for k in (3, 4, 20, 41, len(names) - 1)]
    for name in gone:
        journal.remove(name)
    edited = model.edited(journal.sum())
    other = tiny_corpus(tmp_path / "again", utterances=14, fps=60)
    for name in gone:
        other.remove_node(name)
    trained = Efase().fit(other)
    trained.facts["median_transition"] = model.facts["median_transition"]
    trained._keep_bounds()
    assert edited.facts["names"] == trained.facts["names"]
    assert not set(gone) & set(edited.facts["names"])
    for column in ("phones", "visemes", "emotions", "before"):
        np.testing.assert_array_equal(getattr(edited.nodes(), column), getattr(trained.nodes(), column))
    for utterance in list(corpus)[:4]:
        np.testing.assert_allclose(
            model.synthesize(utterance.speech, edits=journal.sum()).frames, trained.synthesize(utterance.speech).frames, atol=1e-3
        )
    assert model.edited(journal.sum()) is model.edited(journal.sum()), "made once"
    assert model.edited(None) is model


def test_a_drawn_node_is_found_constrained_and_mapped(corpus, model, journal):
    rng, names = np.random.default_rng(0), model.facts["names"]
    utterance = corpus[corpus.ids[0]]
    name = f"{utterance.id}:1"
    assert name in names
    phone, emotion = utterance.speech.phones.labels[1], utterance.emotion
    node = journal.add(phone, emotion, drawn_like(corpus, name, rng), "wider")
    path = model.explain(utterance.speech, constraints={1: node.name}, edits=journal.sum())
    assert path[1]["node"] == node.name
    assert path[1]["right_phone"]
    edited = model.edited(journal.sum())
    before, after = model.phone_map(phone), edited.phone_map(phone)
    assert node.name in after.cluster.names
    shared = after.cluster.names.index(node.name)
    assert after.cluster.emotions[shared] == emotion
    stays = next(one for one in before.cluster.names if one in after.cluster.names)
    np.testing.assert_array_equal(after.curve(stays), before.curve(stays))
    near = np.linalg.norm(after.curve(node.name).mean(axis=0) - before.curve(name).mean(axis=0))
    assert near < 0.5 * np.ptp(before.plane.points, axis=0).max()
    for one in before.cluster.names:
        journal.remove(one)
    alone = replace(utterance.speech, phones=PhoneTrack(("pau", phone, "pau"), np.array([0.2, 0.3, 0.5])))
    assert model.explain(alone)[1]["node"] != node.name
    assert model.explain(alone, edits=journal.sum())[1]["node"] == node.name, "nothing else says this phone any more"


def test_an_editor_takes_edits_and_takes_them_back(corpus, model, journal):
    speech, editor = corpus[corpus.ids[2]].speech, model.edit()
    first = editor.change(speech)
    chosen = first.choices()[2]["node"]
    journal.remove(chosen)
    second = editor.change(speech, edits=journal.sum())
    assert second.choices()[2]["node"] != chosen
    assert second.changed_s is not None
    assert second.motion().frames.tobytes() == model.synthesize(speech, edits=journal.sum()).frames.tobytes()
    third = editor.change(speech)
    assert third.motion().frames.tobytes() == first.motion().frames.tobytes()
    assert editor.change(speech).changed_s is None


def test_a_model_that_hears_can_be_edited(corpus, journal):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(prediction, "STEPS", 6)
        hearing = Efase(audio_weight=0.2, pose_weight=0.5, temperature=0.3, candidates=20).fit(corpus)
    names, before = hearing.facts["names"], hearing.audio.sound.nodes.clone()
    journal.remove(names[2])
    journal.add("aa", "sad", drawn_like(corpus, names[5], np.random.default_rng(1)))
    edited = hearing.edited(journal.sum())
    assert edited.audio.sound.nodes.shape[0] == len(names)
    assert np.isfinite(edited.synthesize(corpus[corpus.ids[1]].speech).frames).all()
    np.testing.assert_array_equal(hearing.audio.sound.nodes, before)


def test_a_drawn_node_may_be_removed_before_any_model_had_it(corpus, model, journal):
    speech = corpus[corpus.ids[0]].speech
    plain = model.synthesize(speech)
    drawn = journal.add("aa", "neutral", np.zeros((4, corpus.layout.channels)))
    journal.remove(drawn.name)
    np.testing.assert_array_equal(model.synthesize(speech, edits=journal.sum()).frames, plain.frames)


def test_edits_are_a_file_of_speak(corpus, model, tmp_path):
    speech, name = corpus[corpus.ids[0]].speech, model.facts["names"][0]
    path = tmp_path / "edits.jsonl"
    lines = [{"op": "remove", "node": name}, {"op": "remove", "node": "nobody:3"}]
    path.write_text(json.dumps(lines[0]) + "\n")
    edits = read_option(model, "edits", path, speech.phones)
    assert edits.removed == {name}
    path.write_text("\n".join(map(json.dumps, lines)))
    with pytest.raises(FacesynthError, match="nobody:3"):
        model.synthesize(speech, edits=read_option(model, "edits", path, speech.phones))
    with pytest.raises(FacesynthError, match="no such file"):
        read_option(model, "edits", tmp_path / "none.jsonl", speech.phones)


def test_what_does_not_fit_the_model_is_refused(corpus, model, journal, tmp_path):
    rng, speech = np.random.default_rng(2), corpus[corpus.ids[0]].speech
    frames = drawn_like(corpus, model.facts["names"][5], rng)
    for phone, emotion, values, said in (
        ("pau", "sad", frames, "pau"),
        ("aa", "proud", frames, "proud"),
        ("aa", "sad", frames[:, :40], "42"),
    ):
        journal = Journal(tmp_path / f"{phone}{emotion}{values.shape[1]}.jsonl")
        journal.add(phone, emotion, values)
        with pytest.raises(FacesynthError, match=said):
            model.synthesize(speech, edits=journal.sum())
    everything = Journal(tmp_path / "all.jsonl").sum()
    with pytest.raises(FacesynthError, match="every node"):
        model.synthesize(speech, edits=replace(everything, removed=frozenset(model.facts["names"])))


def test_drawn_nodes_of_training_and_of_edits_are_told_apart(corpus, tmp_path):
    other = tiny_corpus(tmp_path / "drawn", utterances=6, fps=60)
    rng = np.random.default_rng(3)
    node = other.add_node("aa", "sad", drawn_like(other, f"{other.ids[0]}:2", rng))
    other.remove_node(f"{other.ids[0]}:4")
    trained = Efase().fit(other)
    trained.save(tmp_path / "model.safetensors")
    kept = load(tmp_path / "model.safetensors")
    speech = other[other.ids[0]].speech
    assert node.name in kept.facts["names"]
    same = kept.synthesize(speech, edits=other.journal.sum())
    assert same.frames.tobytes() == kept.synthesize(speech).frames.tobytes(), "what was trained so already changes nothing"
    strange = Journal(tmp_path / "strange.jsonl")
    strange.add("iy", "sad", drawn_like(other, f"{other.ids[0]}:2", rng))
    with pytest.raises(FacesynthError, match="another node"):
        kept.synthesize(speech, edits=strange.sum())
