import dataclasses

import numpy as np
import pytest
from corpora import tiny_corpus, tiny_layout

from facesynth.inference import long_arrays, ragged
from facesynth.inference.anime_graph.assembly import Blender, make_piece
from facesynth.inference.anime_graph.lowpass import LowPass
from facesynth.inference.anime_graph.model import AnimeGraph as Runtime
from facesynth.inference.closures import ClosingLips, close_at
from facesynth.inference.errors import FacesynthError
from facesynth.inference.lips import bilabial_spans, lip_gap
from facesynth.inference.motion import Motion
from facesynth.inference.phones import PHONES
from facesynth.inference.speech import EmotionTrack, PhoneTrack, Speech
from facesynth.methods.anime_graph.lowpass import energy_spectrum
from facesynth.methods.anime_graph.method import AnimeGraph


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("anime") / "corpus", utterances=24)


@pytest.fixture(scope="module")
def model(corpus):
    return AnimeGraph().fit(corpus)


@pytest.fixture(scope="module")
def unseen(corpus):
    """A model of some sentences, and an utterance of another."""
    train, test = corpus.split()
    return AnimeGraph().fit(train), next(iter(test))


def said(utterance, **changes):
    return dataclasses.replace(utterance.speech, **changes)


def test_every_phone_is_a_node_linked_to_the_next(corpus, model):
    graph = model.graph
    assert len(graph) == sum(len(u.speech.phones) for u in corpus)
    first = next(iter(corpus))
    nodes = np.flatnonzero(graph.utterances == 0)
    assert [PHONES[p] for p in graph.phones[nodes]] == list(first.speech.phones.labels)
    np.testing.assert_array_equal(graph.after[nodes[:-1]], nodes[1:])
    np.testing.assert_array_equal(graph.before[nodes[1:]], nodes[:-1])
    assert graph.after[nodes[-1]] == graph.before[nodes[0]] == -1


def test_a_recorded_sentence_returns_itself_without_a_jump(corpus, model):
    for utterance in list(corpus)[:4]:
        plan = model.plan(utterance.speech)
        assert plan.cost == 0
        assert not plan.jumps.any()
        motion = model.runtime().joined(plan)
        np.testing.assert_allclose(motion, model.components.encode_array(utterance.motion.frames), atol=1e-4)


def test_output_is_as_long_as_the_phones_and_close_to_the_recording(unseen):
    model, utterance = unseen
    motion = model.synthesize(utterance.speech)
    assert motion.frames.shape == utterance.motion.frames.shape
    error = np.linalg.norm(motion.points - utterance.motion.points, axis=-1).mean()
    still = np.linalg.norm(utterance.motion.points - utterance.motion.points.mean(axis=0), axis=-1).mean()
    assert error < 1.5 * still


def test_lips_close_at_every_bilabial(unseen):
    model, utterance = unseen
    gap = lip_gap(model.synthesize(utterance.speech))
    for start, stop in bilabial_spans(utterance.speech.phones, model.fps):
        assert gap[start:stop].min() <= model.facts["closed_gap"] + 0.05


def test_save_and_load_give_the_same_bytes(unseen, tmp_path):
    model, utterance = unseen
    model.save(tmp_path / "model.safetensors")
    again = AnimeGraph.load(tmp_path / "model.safetensors")
    first, second = (m.synthesize(utterance.speech).frames for m in (model, again))
    assert first.tobytes() == second.tobytes()


def test_what_smoothing_leaves_lies_below_the_cutoffs(unseen):
    model, utterance = unseen
    blended = model.runtime().joined(model.plan(utterance.speech))
    smooth = LowPass(model.cutoffs_hz.numpy(), model.fps)(blended)
    assert model.cutoffs_hz.shape == (smooth.shape[1],)
    assert share_above(smooth, model).max() <= 0.01


def test_smoothing_keeps_what_was_captured(corpus, model):
    kept, captured = 0.0, 0.0
    for utterance in corpus:
        motion = model.components.encode_array(utterance.motion.frames)
        smooth = LowPass(model.cutoffs_hz.numpy(), model.fps)(motion)
        kept, captured = kept + np.square(smooth - motion.mean(axis=0)).sum(axis=0), captured + len(motion) * motion.var(axis=0)
    assert (kept / captured).min() >= 0.95


def test_lips_that_close_hold_no_jump(unseen):
    model, utterance = unseen
    spoken = model.components.encode_array(model.synthesize(utterance.speech).frames)
    assert share_above(spoken, model).max() <= 0.02


def share_above(components, model):
    """[D] share of each component's energy above its cut-off frequency."""
    frequencies, energy = energy_spectrum([components], model.fps)
    above = frequencies[:, None] > model.cutoffs_hz.numpy()
    return (energy * above).sum(axis=0) / energy.sum(axis=0)


def test_look_ahead_costs_as_much_or_more(unseen):
    model, utterance = unseen
    best = model.plan(utterance.speech).cost
    costs = [model.plan(utterance.speech, look_ahead=phones).cost for phones in (1, 3, 6, 40)]
    assert min(costs) >= best * (1 - 1e-12)
    assert costs[-1] == pytest.approx(best)


def test_stream_gives_the_motion_of_the_look_ahead(unseen):
    model, utterance = unseen
    pieces = list(model.stream(model.wishes(utterance.speech), look_ahead=3))
    assert sum(len(piece) > 0 for piece in pieces) > 4
    whole = model.synthesize(utterance.speech, look_ahead=3).frames
    streamed = np.concatenate(pieces)
    assert streamed.shape == whole.shape
    assert np.median(np.abs(streamed - whole)) < 0.02


def test_lips_close_in_a_stream_too(unseen):
    model, utterance = unseen
    stream = model.open_stream(look_ahead=3)
    pieces = [*(stream.push(wish) for wish in model.wishes(utterance.speech)), stream.finish()]
    gap = lip_gap(Motion(np.concatenate(pieces), model.fps, model.fitted_layout))
    spans = bilabial_spans(utterance.speech.phones, model.fps)
    assert spans
    for start, stop in spans:
        assert gap[start:stop].min() <= model.facts["closed_gap"] + 0.05


@pytest.mark.parametrize("size", [1, 7, 40])
def test_closing_lips_piece_by_piece_is_the_same_as_at_once(size):
    layout, fps = tiny_layout(), 60.0
    rng = np.random.default_rng(0)
    frames = np.array(layout.neutral) + np.cumsum(rng.normal(size=(200, layout.channels)), axis=0) * 0.3
    spans = [(10, 13), (14, 20), (60, 90), (120, 122), (190, 200)]
    lips, pieces, told = ClosingLips(layout, -3.0, fps), [], 0
    for start in range(0, 200, size):
        while told < len(spans) and spans[told][0] <= start + size + 15:
            lips.expect(*spans[told])
            told += 1
        pieces.append(lips.push(frames[start : start + size]))
    pieces.append(lips.finish())
    np.testing.assert_allclose(np.concatenate(pieces), close_at(frames, layout, spans, -3.0, fps))


def test_what_looking_ahead_loses_is_told(unseen):
    model, utterance = unseen
    plan = model.plan(utterance.speech, look_ahead=1)
    assert plan.extra_cost == pytest.approx(plan.cost / model.plan(utterance.speech).cost - 1)
    assert plan.summary()["extra_cost"] == plan.extra_cost >= 0
    stream = model.open_stream(look_ahead=1)
    for wish in model.wishes(utterance.speech):
        stream.push(wish)
    stream.finish()
    assert stream.extra_cost == pytest.approx(plan.extra_cost, abs=1e-9)


def test_emotion_chooses_the_candidates(model, corpus):
    utterance = next(iter(corpus))
    sad = said(utterance, emotions=EmotionTrack.constant("sad", utterance.speech.duration_s))
    nodes = model.plan(sad).nodes
    levels = [c.emotion_level for c in model.plan(sad).candidates]
    for node, level in zip(nodes, levels, strict=True):
        assert level != "emotion" or model.emotions[model.graph.emotions[node]] == "sad"
    assert "emotion" in levels


def test_a_phone_that_the_graph_lacks_is_expressed_by_its_class(model, corpus):
    utterance = next(iter(corpus))
    phones = utterance.speech.phones
    labels = ("zh", "ng", *phones.labels[2:])
    plan = model.plan(said(utterance, phones=PhoneTrack(labels, phones.ends_s)))
    assert plan.summary()["phone_fallbacks"]["viseme"] == 2
    assert PHONES[model.graph.phones[plan.nodes[0]]] == "s"
    strange = said(utterance, phones=PhoneTrack(("hh", *phones.labels[1:]), phones.ends_s))
    assert model.plan(strange).summary()["phone_fallbacks"] == {"any phone": 1}


def test_incomplete_phones_and_removed_nodes_break_the_run(tmp_path):
    corpus = tiny_corpus(tmp_path / "corpus", utterances=3)
    name = corpus.ids[0]
    corpus.remove_node(f"{name}:3")
    path = corpus.files.motion(name)
    with np.load(path, allow_pickle=False) as file:
        arrays = dict(file)
    bounds = corpus[name].speech.phones.frame_bounds(corpus.fps)
    arrays["frames"][bounds[6] : bounds[8], :3] = np.nan
    np.savez(path, **arrays)
    graph = AnimeGraph().fit(corpus).graph
    numbers = graph.numbers[graph.utterances == 0].tolist()
    assert not {3, 6, 7} & set(numbers)
    node = int(np.flatnonzero((graph.utterances == 0) & (graph.numbers == 2))[0])
    assert graph.after[node] == -1
    assert graph.run_stops[node] == graph.stops[node]
    assert np.isfinite(graph.frames).all()


def test_explains_every_phone(unseen):
    model, utterance = unseen
    rows = model.explain(utterance.speech)
    assert len(rows) == len(utterance.speech.phones)
    assert sum(r["jump"] + r["jump_cost"] + r["audio_cost"] for r in rows) == pytest.approx(model.plan(utterance.speech).cost)
    assert all(":" in r["node"] for r in rows)


def test_reports_what_others_expressed_and_where_it_jumped(unseen):
    model, utterance = unseen
    report, plan = model.report(utterance.speech), model.plan(utterance.speech)
    assert 0 <= report["other_visemes"] <= report["other_phones"] <= 1
    assert len(model.joins(utterance.speech)) == plan.jumps.sum() == plan.summary()["jumps"]


def test_bad_speech_is_one_clear_line(model, corpus):
    utterance = next(iter(corpus))
    length = utterance.speech.duration_s
    with pytest.raises(FacesynthError, match="unknown emotion 'bored'"):
        model.synthesize(said(utterance, emotions=EmotionTrack.constant("bored", length)))
    with pytest.raises(FacesynthError, match="constant"):
        model.synthesize(said(utterance, audio=np.full(16000, 0.3)))
    with pytest.raises(FacesynthError, match="unknown phone"):
        model.synthesize(Speech(np.ones(10), 16000, PhoneTrack(("xx",), np.array([1.0])), EmotionTrack.constant("sad", 1.0)))
    with pytest.raises(FacesynthError, match="not trained"):
        AnimeGraph().synthesize(utterance.speech)


def test_nothing_that_moves_is_refused(tmp_path):
    corpus = tiny_corpus(tmp_path / "corpus", utterances=1)
    path = corpus.files.motion(corpus.ids[0])
    with np.load(path, allow_pickle=False) as file:
        arrays = dict(file)
    arrays["frames"][:] = arrays["frames"][:1]
    np.savez(path, **arrays)
    with pytest.raises(FacesynthError, match="nothing moves"):
        AnimeGraph().fit(corpus)


def test_a_minute_of_speech(model, corpus):
    parts, starts = [], [0.0]
    while starts[-1] < 62:
        parts.append(corpus[corpus.ids[len(parts) % len(corpus)]].speech)
        starts.append(starts[-1] + parts[-1].phones.duration_s)
    ends = np.concatenate([p.phones.ends_s + start for p, start in zip(parts, starts, strict=False)])
    phones = PhoneTrack(tuple(label for p in parts for label in p.phones.labels), ends)
    emotions = EmotionTrack(tuple(p.emotions.labels[0] for p in parts), np.array(starts[1:]), np.ones(len(parts)))
    audio = np.concatenate([np.resize(p.audio, round(p.phones.duration_s * p.sample_rate)) for p in parts])
    motion = model.synthesize(Speech(audio, parts[0].sample_rate, phones, emotions))
    assert len(motion) == round(phones.duration_s * model.fps) >= 62 * model.fps
    assert np.isfinite(motion.frames).all()
    assert len(np.concatenate(list(model.stream(model.wishes(Speech(audio, 16000, phones, emotions)))))) == len(motion)


def test_jumps_can_be_bridged_without_recorded_pairs(corpus, unseen):
    model, utterance = unseen
    plain = AnimeGraph(help_pairs=False).fit(corpus.split()[0])
    hows = []
    for m in (model, plain):
        plan, blender = m.plan(utterance.speech), Blender(m.chooser, m.fps, help_pairs=m.config["help_pairs"])
        for t, recorded in enumerate([False, *~plan.jumps]):
            blender.add(make_piece(m.chooser, plan.wishes[t], plan.candidates[t], plan.path[t]), recorded)
        frames = [blender.blended(t) for t in range(len(plan.path))]
        np.testing.assert_array_equal(np.concatenate(frames), m.runtime().joined(plan))
        hows.append({join.how for join in blender.joins.values()})
    assert "help" in hows[0]
    assert hows[1] == {"extension"}


def test_with_a_temperature_the_motion_is_the_mean_over_paths(unseen):
    model, utterance = unseen
    soft = AnimeGraph(temperature=2.0, jump_weight=10.0, jump_cost_weight=3.0, audio_weight=1.5)
    soft.layout, soft.fps, soft.emotions, soft.facts = model.layout, model.fps, model.emotions, model.facts
    soft.audio, soft.components, soft.maps, soft.nodes = model.audio, model.components, model.maps, model.nodes
    soft.register_buffer("cutoffs_hz", model.cutoffs_hz)
    mean, cheapest = soft.synthesize(utterance.speech), model.synthesize(utterance.speech)
    assert mean.frames.shape == cheapest.frames.shape
    assert np.abs(np.diff(mean.frames, axis=0)).sum() < np.abs(np.diff(cheapest.frames, axis=0)).sum()
    soft.config |= model.config
    np.testing.assert_array_equal(soft.synthesize(utterance.speech).frames, cheapest.frames)


def test_a_temperature_below_zero():
    with pytest.raises(FacesynthError, match="temperature"):
        AnimeGraph(temperature=-1.0)


def test_an_account_needs_no_second_search(unseen, monkeypatch):
    model, utterance = unseen
    model.synthesize(utterance.speech)
    summary = model.plan(utterance.speech).summary()
    monkeypatch.setattr(Runtime, "plan", lambda *_args, **_options: pytest.fail("searched again"))
    assert model.account(utterance.speech).facts == summary
    with pytest.raises(pytest.fail.Exception, match="searched again"):
        model.account(utterance.speech, look_ahead=3)


def test_what_lies_in_files_gives_the_same_motion(unseen, monkeypatch):
    model, utterance = unseen
    wanted = model.synthesize(utterance.speech).frames
    monkeypatch.setattr(long_arrays, "LARGE_BYTES", 64)
    monkeypatch.setattr(long_arrays, "BLOCK_ROWS", 16)
    monkeypatch.setattr(ragged, "LOOKED_AT", 3)
    assert model.synthesize(utterance.speech).frames.tobytes() == wanted.tobytes()
