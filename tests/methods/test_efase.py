"""eFASE as a method: what it learns, obeys, explains and refuses."""

import json
from dataclasses import replace

import numpy as np
import pytest
from corpora import tiny_corpus
from literal_search import literal
from safetensors import safe_open
from safetensors.torch import save_file

from facesynth.config import load_config
from facesynth.corpus import node_name
from facesynth.evaluation.emotion_recognition import EmotionRecogniser
from facesynth.inference.efase.bounds import step_bounds
from facesynth.inference.efase.costs import all_targets
from facesynth.inference.efase.search import SearchIndex
from facesynth.inference.efase.steps import path_cost
from facesynth.inference.errors import FacesynthError
from facesynth.inference.phones import PHONES
from facesynth.inference.speech import EmotionTrack, PhoneTrack, Speech
from facesynth.methods.efase.constraints import read_constraints
from facesynth.methods.efase.method import Efase
from facesynth.methods.efase.torch_search import torch_engine
from facesynth.methods.registry import create, load


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("actor") / "corpus", utterances=28, fps=60)


@pytest.fixture(scope="module")
def halves(corpus):
    return corpus.split(0)


@pytest.fixture(scope="module")
def model(halves):
    return Efase().fit(halves[0])


@pytest.fixture
def speech(halves):
    return next(iter(halves[1])).speech


def test_nodes_are_the_spoken_phones_and_know_their_neighbours(model, halves):
    nodes, names = model.nodes(), model.facts["names"]
    place = 0
    for utterance in halves[0]:
        previous = None
        for number, label in enumerate(utterance.speech.phones.labels):
            if label == "pau":
                previous = None
                continue
            assert names[place] == node_name(utterance.id, number)
            assert PHONES[nodes.phones[place]] == label
            assert nodes.before[place] == (-1 if previous is None else previous)
            previous = place
            place += 1
    assert place == len(nodes)


def test_motion_is_as_long_as_the_phones_at_any_rate(model, speech):
    for fps in (24, 23.976, 25, 29.97, 60, 120):
        assert len(model.synthesize(speech, fps=fps)) == speech.phones.frame_bounds(fps)[-1]


def test_the_same_twice_and_after_saving(model, speech, tmp_path):
    first = model.synthesize(speech).frames.tobytes()
    assert model.synthesize(speech).frames.tobytes() == first
    paths = [tmp_path / "größe a.safetensors", tmp_path / "b.safetensors"]
    for path in paths:
        model.save(path)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    assert load(paths[0]).synthesize(speech).frames.tobytes() == first


def test_a_recorded_sentence_is_said_as_it_was_recorded(model, halves):
    utterance = next(iter(halves[0]))
    made = model.synthesize(utterance.speech)
    assert model.report(utterance.speech) == {"other_phones": 0, "other_visemes": 0, "other_emotions": 0}
    assert not len(model.joins(utterance.speech))
    spoken = np.repeat([p != "pau" for p in utterance.speech.phones.labels], np.diff(utterance.speech.phones.frame_bounds(60)))
    spoken[:3] = spoken[-3:] = False
    error = np.abs(made.frames - utterance.motion.frames)[spoken]
    assert np.nanmean(error) < 0.1


def test_constraints_are_obeyed_and_distant_frames_do_not_change(model, halves):
    speech = max((u.speech for u in halves[1]), key=lambda s: len(s.phones))
    index = next(i for i, p in enumerate(speech.phones.labels) if p != "pau")
    free = model.plan(speech)
    other = next(n for n in range(len(model.facts["names"])) if n != free.nodes[index])
    name = model.facts["names"][other]
    assert model.plan(speech, constraints={index: name}).nodes[index] == other
    base, changed = model.synthesize(speech), model.synthesize(speech, constraints={index: name})
    moved = np.flatnonzero(np.abs(base.frames - changed.frames).max(axis=1) > 1e-4) / base.fps
    assert len(moved)
    assert moved.max() < speech.phones.ends_s[index] + 0.6 * speech.phones.duration_s
    rows = model.explain(speech, constraints={index: name})
    assert rows[index]["node"] == name
    assert rows[index]["constrained"]


def test_constraint_files(tmp_path):
    phones = PhoneTrack(("pau", "aa", "b"), np.array([0.2, 0.5, 0.7]))
    path = tmp_path / "c.csv"
    path.write_text("time_s,utterance_id,phone_number\n0.3,s01,4\n", encoding="utf-8")
    assert read_constraints(path, phones) == {1: "s01:4"}
    path.write_text("phone_index,utterance_id,phone_number\n2,s01,4\n", encoding="utf-8")
    assert read_constraints(path, phones) == {2: "s01:4"}
    for text, message in (
        ("phone_index,utterance_id,phone_number\n3,s01,4\n", "phones 0 to 2"),
        ("time_s,utterance_id,phone_number\n0.7,s01,4\n", "ends at 0.700"),
        ("time_s,utterance_id,phone_number\nsoon,s01,4\n", "line 2"),
        ("a,b\n1,2\n", "wanted columns"),
    ):
        path.write_text(text, encoding="utf-8")
        with pytest.raises(FacesynthError, match=message):
            read_constraints(path, phones)


@pytest.mark.parametrize(
    ("constraints", "message"), [({1: "nobody:3"}, "unknown node"), ({999: "s:1"}, "no phone 999"), ({0: "s:1"}, "silence")]
)
def test_impossible_constraints(model, speech, constraints, message):
    assert speech.phones.labels[0] == "pau"
    with pytest.raises(FacesynthError, match=message):
        model.plan(speech, constraints=constraints)


def test_unknown_phones_and_emotions(model, speech):
    strange = replace(speech, phones=PhoneTrack(("xx",), np.array([1.0])))
    with pytest.raises(FacesynthError, match="unknown phone 'xx'"):
        model.synthesize(strange)
    bored = replace(speech, emotions=EmotionTrack.constant("bored", speech.duration_s))
    with pytest.raises(FacesynthError, match="unknown emotion 'bored'"):
        model.synthesize(bored)


def with_emotion(speech, *labels, intensity=1.0):
    ends = speech.duration_s * np.arange(1, len(labels) + 1) / len(labels)
    return replace(speech, emotions=EmotionTrack(labels, ends, np.full(len(labels), intensity)))


def test_intensity_runs_from_neutral_to_full_emotion(model, speech):
    def at(intensity):
        return model.synthesize(with_emotion(speech, "happy", intensity=intensity)).frames

    neutral = model.synthesize(with_emotion(speech, "neutral")).frames
    distance = [np.abs(at(i) - neutral).mean() for i in (0.0, 0.5, 1.0)]
    assert distance[0] < 0.05 * distance[2]
    assert distance[0] < distance[1] < distance[2]


def test_lips_close_after_a_blend_of_two_intensities(model, halves):
    from facesynth.inference.lips import lip_gap

    for utterance in halves[1]:
        speech = utterance.speech
        half, sad, plain = (
            lip_gap(model.synthesize(with_emotion(speech, e, intensity=i), fps=120))
            for e, i in (("sad", 0.5), ("sad", 1.0), ("neutral", 1.0))
        )
        bounds = speech.phones.frame_bounds(120)
        for label, start, stop in zip(speech.phones.labels, bounds[:-1], bounds[1:], strict=True):
            if label in ("p", "b", "m"):
                assert half[start:stop].min() <= max(sad[start:stop].min(), plain[start:stop].min()) + 1e-3


def test_emotion_modifiers_over_time_choose_nodes_of_that_emotion(model, speech):
    track = with_emotion(speech, "happy", "sad")
    felt = track.emotions.per_phone(track.phones)[0]
    rows = model.explain(track)
    spoken = [row for row in rows if row["node"]]
    assert {row["emotion"] for row in spoken} == {"happy", "sad"}
    assert [row["emotion"] for row in spoken] == [felt[row["index"]] for row in spoken]
    assert np.mean([row["right_emotion"] for row in spoken]) > 0.8


def test_the_asked_emotion_is_recognised_on_held_out_sentences(model, halves):
    recogniser = EmotionRecogniser.fit(halves[0])
    asked, seen = [], []
    for utterance in halves[1]:
        for emotion in model.emotions:
            asked.append(emotion)
            seen.append(recogniser.recognise(model.synthesize(with_emotion(utterance.speech, emotion))))
    assert np.mean(np.array(asked) == seen) >= 0.8


def test_removed_and_added_nodes_are_honoured(tmp_path):
    corpus = tiny_corpus(tmp_path / "actor", utterances=8, fps=60)
    before = Efase().fit(corpus)
    name = before.facts["names"][5]
    corpus.remove_node(name)
    added = corpus.add_node("aa", "happy", np.zeros((8, corpus.layout.channels)) + 3)
    after = Efase().fit(corpus)
    assert name not in after.facts["names"]
    assert added.name in after.facts["names"]
    nodes = after.nodes()
    follower = after.facts["names"].index(before.facts["names"][6])
    assert nodes.before[follower] == -1
    assert nodes.before[-1] == nodes.after[-1] == -1
    corpus.undo()
    corpus.undo()
    assert Efase().fit(corpus).facts["names"] == before.facts["names"]


def test_long_gaps_break_a_sentence(tmp_path):
    corpus = tiny_corpus(tmp_path / "actor", utterances=6, fps=60)
    path = corpus.path / "motion" / f"{corpus.ids[0]}.npz"
    with np.load(path) as file:
        arrays = dict(file)
    arrays["frames"][40:60, :3] = np.nan
    np.savez(path, **arrays)
    model = Efase().fit(type(corpus).open(corpus.path))
    assert model.facts["unusable_phones"] > 0
    assert np.isfinite(model.node_frames.numpy()).all()


def test_pauses_part_the_search_unless_they_are_bridged(model, speech):
    speech = repeated(speech, 2)
    silent = np.array([label == "pau" for label in speech.phones.labels])
    assert silent[1:-1].any()
    parted = model.plan(speech)
    np.testing.assert_array_equal(parted.nodes < 0, silent)
    bridged = model.with_weights(bridge_pauses=True).plan(speech)
    assert (bridged.nodes >= 0).all()


def test_the_search_by_tensors_finds_the_same_path(model, speech):
    nodes, weights = model.nodes(), model.weights()
    query = model.plan(speech).query
    assert (query.phones < 0).any()  # silence is a step here
    targets = all_targets(nodes, query, weights)
    np.testing.assert_array_equal(torch_engine(nodes, weights)(targets), model.speaker.index.cheapest_path(targets))


def test_equals_the_literal_algorithm_on_a_recorded_database(model, halves):
    nodes, weights = model.nodes().take(np.arange(90)), model.weights()
    index = SearchIndex(nodes, weights, step_bounds(nodes, weights))
    for utterance in list(halves[1])[:3]:
        query = model.plan(utterance.speech).query
        cost, path = literal(nodes, query, weights)
        found = index.cheapest_path(all_targets(nodes, query, weights))
        np.testing.assert_allclose(path_cost(nodes, query, found, weights), cost, rtol=1e-9)
        np.testing.assert_array_equal(found, path)


def test_a_constraint_changes_nothing_beyond_the_next_pause(model, speech):
    long = repeated(speech, 3)
    labels = long.phones.labels
    index = next(i for i, label in enumerate(labels) if label != "pau")
    free = model.plan(long)
    name = next(name for n, name in enumerate(model.facts["names"]) if n != free.nodes[index])
    base, changed = model.synthesize(long), model.synthesize(long, constraints={index: name})
    pause = next(i for i, label in enumerate(labels) if label == "pau" and i > index)
    first = int(np.ceil(long.phones.ends_s[pause] * base.fps)) + 1
    assert first < len(base) / 2
    np.testing.assert_array_equal(base.frames[first:], changed.frames[first:])
    assert np.abs(base.frames[:first] - changed.frames[:first]).max() > 1e-3


def repeated(speech, count):
    ends = np.concatenate([speech.phones.ends_s + k * speech.duration_s for k in range(count)])
    phones = PhoneTrack(speech.phones.labels * count, ends)
    return Speech(np.zeros(10, np.float32), 16000, phones, EmotionTrack.constant("happy", ends[-1]))


def test_minutes_of_speech(model, speech):
    long = repeated(speech, 80)
    assert long.duration_s > 120
    assert len(model.synthesize(long)) == round(long.duration_s * 60)


def test_a_corpus_of_one_utterance_is_refused(corpus):
    with pytest.raises(FacesynthError, match="at least 2 usable utterances"):
        Efase().fit(corpus.subset(corpus.ids[:1]))


def test_the_shipped_settings_are_the_defaults(repository):
    assert Efase.from_config(load_config(repository / "configs" / "efase.yaml")).config == Efase().config
    published = Efase.from_config(load_config(repository / "configs" / "efase_published.yaml"))
    assert published.config["alpha"] == 3.6052
    with pytest.raises(FacesynthError, match="did you mean penalty"):
        create("efase", penalti=3)
    with pytest.raises(FacesynthError, match="efase"):
        create("efsae")


def test_untrained_models_say_so(speech, tmp_path):
    with pytest.raises(FacesynthError, match="not trained"):
        Efase().synthesize(speech)
    with pytest.raises(FacesynthError, match="not trained"):
        Efase().save(tmp_path / "m.safetensors")


def test_model_files_that_are_none(model, tmp_path):
    path = tmp_path / "m.safetensors"
    model.save(path)
    whole = path.read_bytes()
    for content, message in ((whole[:-100], "truncated"), (b"hello", "not a facesynth model"), (b"", "not a facesynth model")):
        path.write_bytes(content)
        with pytest.raises(FacesynthError, match=message):
            load(path)
    path.write_bytes(whole.replace(b'\\"format\\": 2', b'\\"format\\": 9'))
    with pytest.raises(FacesynthError, match="format 9"):
        load(path)
    with pytest.raises(FacesynthError, match="no such model"):
        load(tmp_path / "nothing.safetensors")


@pytest.mark.parametrize("spoil", ["config", "node_frames", "bounds_in", "short"])
def test_model_files_with_something_missing(model, tmp_path, spoil):
    path = tmp_path / "m.safetensors"
    model.save(path)
    with safe_open(path, "pt") as file:
        header = json.loads(file.metadata()["facesynth"])
        tensors = {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118 - safe_open is no mapping
    header.pop(spoil, None)
    tensors.pop(spoil, None)
    if spoil == "short":
        tensors["node_frames"] = tensors["node_frames"][:5].contiguous()
    save_file(tensors, path, metadata={"facesynth": json.dumps(header)})
    with pytest.raises(FacesynthError, match="damaged"):
        load(path)


def test_licence_and_consent_travel_with_the_model(model, halves, tmp_path):
    model.save(tmp_path / "m.safetensors")
    assert load(tmp_path / "m.safetensors").provenance == halves[0].provenance()
    assert {"licences", "consents", "performer", "synthetic"} <= set(model.provenance)
