"""Speech that is changed again and again: an editor gives what synthesis gives, searches only what changed, shows windows."""

from dataclasses import replace

import numpy as np
import pytest
from corpora import tiny_corpus
from every_method import METHODS, trained_on
from literal_search import literal
from test_efase_search import random_nodes, random_query

from facesynth.inference.efase.bounds import step_bounds
from facesynth.inference.efase.costs import Query, Weights, all_targets
from facesynth.inference.efase.kept import KeptSearches
from facesynth.inference.efase.search import SearchIndex
from facesynth.inference.errors import FacesynthError
from facesynth.inference.speech import EmotionTrack, PhoneTrack
from facesynth.methods.editing import PlainEditor, editor_of
from facesynth.methods.efase.method import Efase
from facesynth.methods.learn import expectation as prediction
from facesynth.methods.registry import capabilities_of


@pytest.fixture(scope="module")
def halves(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("editing") / "corpus", utterances=28, fps=60).split(0)


@pytest.fixture(scope="module")
def model(halves):
    return Efase().fit(halves[0])


@pytest.fixture
def speech(halves):
    said = [utterance.speech for utterance in halves[1]][:3]
    labels = sum((one.phones.labels for one in said), ())
    starts_s = np.cumsum([0.0, *(one.duration_s for one in said[:-1])])
    ends_s = np.concatenate([start + one.phones.ends_s for start, one in zip(starts_s, said, strict=True)])
    audio = np.concatenate([one.audio for one in said])
    emotions = EmotionTrack(("angry", "sad"), np.array([ends_s[-1] / 2, ends_s[-1]]), np.ones(2))
    return replace(said[0], audio=audio, phones=PhoneTrack(labels, ends_s), emotions=emotions)


def changed(rng, speech, constraints, names):
    """A random edit of a speech and its constraints: what an animator does in a timeline."""
    labels, ends_s = list(speech.phones.labels), speech.phones.ends_s.copy()
    spoken = [t for t, label in enumerate(labels) if label != "pau"]
    at = int(rng.choice([t for t in spoken if 0 < t < len(labels) - 1]))
    kind = rng.integers(7)
    if kind == 0:  # drag a boundary
        ends_s[at] = ends_s[at - 1] + rng.uniform(0.2, 0.8) * (ends_s[at + 1] - ends_s[at - 1])
    elif kind == 1:
        labels[at] = str(rng.choice(["aa", "iy", "m", "s", "w"]))
    elif kind == 2:  # split
        labels.insert(at, labels[at])
        ends_s = np.insert(ends_s, at, (ends_s[at - 1] + ends_s[at]) / 2)
        constraints = {}
    elif kind == 3:  # join
        labels.pop(at)
        ends_s = np.delete(ends_s, at - 1)
        constraints = {}
    elif kind == 4:
        constraints = {at: str(rng.choice(names))}
    else:
        cut_s = float(rng.uniform(0.2, 0.8) * ends_s[-1])
        felt = tuple(str(one) for one in rng.choice(["neutral", "angry", "happy"], 2))
        track = EmotionTrack(felt, np.array([cut_s, ends_s[-1]]), np.array([1.0, rng.choice([0.5, 1.0])]))
        return replace(speech, emotions=track), constraints
    return replace(speech, phones=PhoneTrack(tuple(labels), ends_s)), constraints


@pytest.mark.parametrize("pnt", [0.5, 20.0])
def test_kept_searches_find_the_path_of_a_whole_search_to_the_node(pnt):
    rng = np.random.default_rng(int(pnt))
    for _ in range(4):
        nodes, weights = random_nodes(rng), Weights(pnt)
        index = SearchIndex(nodes, weights, step_bounds(nodes, weights))
        kept, query = KeptSearches(index), random_query(rng, nodes, 10)
        for step in range(16):
            other = random_query(rng, nodes, 10)
            at = np.arange(10) == rng.integers(10)
            columns = (np.where(at, b, a) for a, b in zip(_columns(query), _columns(other), strict=True))
            phones, visemes, emotions, strict = columns
            query = Query(phones, visemes, emotions, {}, strict)
            asked = query.part(np.arange(int(rng.integers(2, 11))))
            targets = all_targets(nodes, asked, weights)
            path = kept(targets)
            np.testing.assert_array_equal(path, index.cheapest_path(targets))
            if step == 9:
                np.testing.assert_array_equal(path, literal(nodes, asked, weights)[1])


def _columns(query):
    return query.phones, query.visemes, query.emotions, query.strict


def test_phones_before_a_change_are_not_searched_again():
    rng = np.random.default_rng(1)
    nodes, weights = random_nodes(rng, 300), Weights(20.0)
    kept = KeptSearches(SearchIndex(nodes, weights, step_bounds(nodes, weights)))
    query = random_query(rng, nodes, 30)
    kept(all_targets(nodes, query, weights))
    for at, count in ((24, 6), (29, 1), (0, 30)):
        before = kept.phones_searched
        changed_query = replace(query, fixed={at: int(rng.integers(300))}, strict=None)
        kept(all_targets(nodes, replace(query, strict=None), weights))
        between = kept.phones_searched
        kept(all_targets(nodes, changed_query, weights))
        assert kept.phones_searched - between == count
        assert between - before <= 30
    before = kept.phones_searched
    kept(all_targets(nodes, query, weights))
    assert kept.phones_searched == before, "undoing costs nothing"


def test_an_editor_gives_what_synthesis_gives_to_the_byte(model, speech):
    rng, constraints, editor = np.random.default_rng(2), {}, model.edit()
    last = None
    for _ in range(16):
        draft = editor.change(speech, constraints=constraints)
        whole = draft.motion()
        assert whole.frames.tobytes() == model.synthesize(speech, constraints=constraints).frames.tobytes()
        _window_is_the_whole_there(draft, whole, rng)
        if last is not None and len(last) == len(whole):
            _only_that_changed(draft, last, whole)
        last = whole
        speech, constraints = changed(rng, speech, constraints, model.facts["names"])


def _window_is_the_whole_there(draft, whole, rng):
    start_s = float(rng.uniform(0, whole.duration_s - 0.3))
    part, first = draft.motion(start_s, start_s + 0.3), round(start_s * whole.fps)
    assert part.fps == whole.fps
    np.testing.assert_allclose(
        part.frames, whole.frames[first : first + len(part)], atol=2e-3 * np.ptp(whole.frames, axis=0).max()
    )


def _only_that_changed(draft, before, after):
    moved = np.abs(after.frames - before.frames).max(axis=1) > 1e-3
    start_s, stop_s = draft.changed_s or (0.0, 0.0)
    outside = (after.times_s < start_s - 1 / after.fps) | (after.times_s > stop_s + 1 / after.fps)
    assert not (moved & outside).any()


def test_a_model_that_hears_and_takes_means_gives_the_same(halves, speech):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(prediction, "STEPS", 12)
        hearing = Efase(
            audio_weight=0.2, pose_weight=0.5, temperature=0.3, candidates=30, expected_share=0.4, sharpening=0.5
        ).fit(halves[0], seed=1)
    rng, constraints, editor = np.random.default_rng(3), {}, hearing.edit()
    for _ in range(7):
        draft = editor.change(speech, constraints=constraints)
        whole, wanted = draft.motion(), hearing.synthesize(speech, constraints=constraints)
        np.testing.assert_allclose(whole.frames, wanted.frames, atol=1e-3)
        _window_is_the_whole_there(draft, whole, rng)
        speech, constraints = changed(rng, speech, constraints, hearing.facts["names"])


def test_what_did_not_change_is_told(model, speech):
    editor = model.edit()
    assert editor.change(speech).changed_s == (0.0, speech.duration_s), "before the first draft there was nothing"
    assert editor.change(replace(speech, text="other")).changed_s is None
    rows = editor.change(speech).choices()
    assert [row["phone"] for row in rows] == list(speech.phones.labels)
    wanted = model.explain(speech)
    assert [row["node"] for row in rows] == [row["node"] for row in wanted]
    assert all("runners_up" not in row for row in rows)


@pytest.mark.parametrize("name", [name for name in METHODS if capabilities_of(name).part == "mouth"])
def test_every_method_can_be_edited(name, halves, speech, monkeypatch):
    method = trained_on(halves[0], name, monkeypatch)
    editor = editor_of(method)
    for said in (speech, replace(speech, emotions=EmotionTrack.constant("sad", speech.duration_s))):
        draft = editor.change(said, seed=4)
        whole = draft.motion()
        np.testing.assert_allclose(whole.frames, method.synthesize(said, seed=4).frames, atol=1e-3)
        part = draft.motion(0.5, 0.75)
        first = round(0.5 * whole.fps)
        np.testing.assert_allclose(part.frames, whole.frames[first : first + len(part)], atol=2e-3 * np.ptp(whole.frames))
        assert len(draft.choices()) in (0, len(said.phones))


@pytest.mark.parametrize("editor_of_model", [lambda model: model.edit(), PlainEditor])
def test_what_cannot_be_meant_is_refused(model, speech, editor_of_model):
    editor = editor_of_model(model)
    with pytest.raises(FacesynthError, match="holds no frame"):
        editor.change(speech).motion(speech.duration_s + 1)
    with pytest.raises(FacesynthError, match="nose"):
        editor.change(speech, nose=1)
    with pytest.raises(FacesynthError, match="node"):
        editor.change(speech, constraints={1: "nobody:3"}).motion()
