import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from facesynth.export.graph import difference
from facesynth.export.models import export_model
from facesynth.inference import FacesynthError, load
from facesynth.inference.anime_graph.search import best_path, step_costs
from facesynth.inference.folder import open_folder
from facesynth.inference.graphs import Graph as OnnxGraph
from facesynth.inference.speech import EmotionTrack, PhoneTrack, Speech
from facesynth.methods.anime_graph.method import AnimeGraph
from facesynth.methods.learn import expectation as prediction


@pytest.fixture(scope="module")
def pair(anime_file, exported):
    return AnimeGraph.load(anime_file), load(exported(anime_file))


def felt(speech, emotion, intensity=1.0):
    track = EmotionTrack.constant(emotion, speech.phones.duration_s, intensity)
    return Speech(speech.audio, speech.sample_rate, speech.phones, track)


@pytest.mark.parametrize("look_ahead", [None, 2])
def test_the_runtime_moves_as_torch_does(pair, speeches, look_ahead):
    model, runtime = pair
    for speech in speeches:
        wanted, got = model.synthesize(speech, look_ahead=look_ahead), runtime.synthesize(speech, look_ahead=look_ahead)
        assert difference(got.frames, wanted.frames) < 1e-4


def test_the_path_is_that_of_torch_or_a_tie(pair, speeches):
    model, runtime = pair
    for speech in speeches:
        wanted, got = model.plan(speech), runtime.plan(speech)
        assert got.cost == pytest.approx(wanted.cost, rel=1e-5)
        assert np.array_equal(got.nodes, wanted.nodes)


@pytest.mark.parametrize("phones", [1, 2, None])
def test_the_path_graph_finds_the_path_of_the_runtime(pair, anime_file, exported, speeches, phones):
    """Fed with the candidates and costs of a plan; the costs beyond a phone's own candidates forbid them."""
    _, runtime = pair
    for speech in speeches:
        plan = runtime.plan(speech)
        steps = plan.steps[:phones]
        path, cost = best_path(steps, runtime.weights)
        most = max(len(step.audio) for step in steps)
        targets, between = np.full((1, len(steps), most), 1e30), np.zeros((1, len(steps) - 1, most, most))
        for t, step in enumerate(steps):
            targets[0, t, : len(step.audio)] = runtime.weights.target(step)
            if t:
                costs = step_costs(steps[t - 1], step, runtime.weights)
                between[0, t - 1, : costs.shape[1], : costs.shape[0]] = costs.T
        got_path, got_cost = OnnxGraph(open_folder(exported(anime_file)), "path_search", 1)(targets=targets, steps=between)
        assert got_cost[0] == pytest.approx(cost, rel=1e-9)
        assert np.array_equal(got_path[0], path)
        if phones is None:
            assert got_cost[0] == pytest.approx(plan.cost, rel=1e-9)
            assert np.array_equal(got_path[0], plan.path)


def test_emotions_are_mapped_as_by_torch(pair, speeches):
    model, runtime = pair
    assert len(runtime.mapper.maps.pairs)
    source, target = (model.emotions[k] for k in runtime.mapper.maps.pairs[0])
    speech = felt(speeches[0], source)
    wanted = model.synthesize(speech, to_emotion=target, to_intensity=0.7)
    got = runtime.synthesize(speech, to_emotion=target, to_intensity=0.7)
    assert difference(got.frames, wanted.frames) < 1e-4
    for emotion in model.emotions:
        weak = felt(speeches[1], emotion, 0.3)
        assert difference(runtime.synthesize(weak).frames, model.synthesize(weak).frames) < 1e-4


@settings(max_examples=8, deadline=None)
@given(seed=st.integers(0, 99), look_ahead=st.integers(1, 4))
def test_pieces_of_any_size_give_what_the_whole_gives(pair, speeches, seed, look_ahead):
    _, runtime = pair
    speech, rng = speeches[seed % len(speeches)], np.random.default_rng(seed)
    wanted = runtime.synthesize(speech, look_ahead=look_ahead).frames
    feelings = speech.emotions.per_phone(speech.phones)[0]
    phones = list(zip(speech.phones.labels, speech.phones.ends_s.tolist(), feelings, strict=True))
    stream, pieces, at = runtime.stream(look_ahead=look_ahead), [], 0
    while at < len(speech.audio) or phones:
        if phones and rng.random() < 0.3:
            pieces.append(stream.push(*phones.pop(0)))
        size = int(rng.choice([1, 50, 160, 999, 5000]))
        pieces.append(stream.hear(speech.audio[at : at + size]))
        at += size
    got = np.concatenate([*pieces, stream.finish()])
    assert difference(got, wanted) < 1e-4


@pytest.fixture(scope="module")
def slow_pair(anime_file, tmp_path_factory):
    """Components that are filtered at 2 Hz."""
    model, folder = AnimeGraph.load(anime_file), tmp_path_factory.mktemp("slow")
    model.cutoffs_hz[:] = torch.tensor([2.0, 2.5, 6.0, 29.9])[torch.arange(len(model.cutoffs_hz)) % 4]
    model.save(folder / "model.safetensors")
    export_model(folder / "model.safetensors", folder / "exported")
    return model, load(folder / "exported")


@settings(max_examples=5, deadline=None)
@given(seed=st.integers(0, 9999), look_ahead=st.integers(1, 3), slow=st.booleans())
def test_drawn_phones_give_what_the_whole_gives(pair, slow_pair, speeches, seed, look_ahead, slow):
    """Of phones that nobody said, whatever the cut-offs: relative to the motion, too."""
    _, runtime = slow_pair if slow else pair
    rng = np.random.default_rng(seed)
    count = int(rng.integers(35, 45))
    labels = tuple(rng.choice(["pau", "aa", "iy", "uw", "m", "p", "s", "t", "k"], count).tolist())
    ends_s = np.cumsum(rng.uniform(0.04, 0.25, count))
    audio = np.resize(np.concatenate([speech.audio for speech in speeches]), int(ends_s[-1] * 16000))
    emotion = str(rng.choice(runtime.emotions))
    speech = Speech(audio, 16000, PhoneTrack(labels, ends_s), EmotionTrack.constant(emotion, float(ends_s[-1])))
    stream, pieces, at = runtime.stream(look_ahead=look_ahead), [], 0
    for label, end_s in zip(labels, ends_s.tolist(), strict=True):
        known = round((end_s + 0.05) * 16000)  # the windows of the phone's sound reach beyond its end
        pieces += [stream.hear(audio[at:known]), stream.push(label, end_s, emotion)]
        at = known
    before_the_end = sum(map(len, pieces))
    got, wanted = np.concatenate([*pieces, stream.finish()]), runtime.synthesize(speech, look_ahead=look_ahead).frames
    assert np.abs(got - wanted).max() < 1e-4 * np.abs(wanted - wanted.mean(axis=0)).max()
    late_s = ends_s[-1] - before_the_end / runtime.fps
    after = look_ahead + runtime.manifest["latency"]["phones_after"]
    closing_s = np.diff(ends_s, prepend=0.0)[np.isin(labels, ["p", "m"])].max()
    assert late_s <= ends_s[-1] - ends_s[-1 - after] + runtime.manifest["latency"]["guard_s"] + closing_s + 1 / runtime.fps


def test_the_stated_guard_is_that_of_the_filter(pair, slow_pair):
    guards_s = [runtime.manifest["latency"]["guard_s"] for _, runtime in (pair, slow_pair)]
    for guard_s, (_, runtime) in zip(guards_s, (pair, slow_pair), strict=True):
        assert guard_s == pytest.approx((runtime.low_pass.settles_frames + 4) / runtime.fps + 0.3, abs=1.5 / runtime.fps)
    assert guards_s[0] < guards_s[1] < 8


def test_a_graph_of_an_older_version_is_not_exported(anime_file, tmp_path):
    model = AnimeGraph.load(anime_file)
    del model.facts["closed_gap"]
    model.save(tmp_path / "old.safetensors")
    with pytest.raises(FacesynthError, match="older version"):
        export_model(tmp_path / "old.safetensors", tmp_path / "exported")


def test_fewer_bits_are_smaller_and_move_nearly_the_same(anime_file, exported, pair, speeches):
    smaller = load(exported(anime_file, "float16"))
    full = sum(path.stat().st_size for path in exported(anime_file).iterdir())
    assert sum(path.stat().st_size for path in exported(anime_file, "float16").iterdir()) < 0.7 * full
    same = np.mean(smaller.plan(speeches[0]).nodes == pair[1].plan(speeches[0]).nodes)
    assert same > 0.7
    if same == 1:
        assert difference(smaller.synthesize(speeches[0]).frames, pair[1].synthesize(speeches[0]).frames) < 0.01


def test_what_is_wrong_is_named(pair, speeches):
    _, runtime = pair
    with pytest.raises(FacesynthError, match="8000 Hz; wanted 16000 Hz"):
        runtime.stream(sample_rate=8000)
    with pytest.raises(FacesynthError, match="look_ahead is 0"):
        runtime.stream(look_ahead=0)
    with pytest.raises(FacesynthError, match="unknown emotion 'bored'"):
        runtime.synthesize(speeches[0], to_emotion="bored")
    with pytest.raises(FacesynthError, match="intensity is 2"):
        runtime.synthesize(speeches[0], to_emotion="happy", to_intensity=2)
    with pytest.raises(FacesynthError, match="wanted sound"):
        runtime.stream().finish()
    silent = Speech(np.zeros(16000, np.float32), 16000, speeches[0].phones, speeches[0].emotions)
    with pytest.raises(FacesynthError, match="constant"):
        runtime.synthesize(silent)


@pytest.fixture(scope="module")
def soft_pair(small_corpus, tmp_path_factory):
    folder = tmp_path_factory.mktemp("soft")
    soft = {"temperature": 2.0, "jump_weight": 10.0, "jump_cost_weight": 3.0, "audio_weight": 1.5}
    soft |= {"pose_weight": 20.0, "sharpening": 0.8}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(prediction, "STEPS", 5)  # how well it predicts does not matter here
        model = AnimeGraph(map_centres=40, emotional_components=[0, 2], **soft).fit(small_corpus)
    model.save(folder / "model.safetensors")
    export_model(folder / "model.safetensors", folder / "exported")
    return model, load(folder / "exported")


def test_means_over_paths_are_those_of_torch(soft_pair, speeches):
    model, runtime = soft_pair
    for speech in speeches:
        wanted, got = model.plan(speech), runtime.plan(speech)
        assert got.cost == pytest.approx(wanted.cost, rel=1e-5)
        assert np.array_equal(got.nodes, wanted.nodes)
        assert difference(runtime.synthesize(speech).frames, model.synthesize(speech).frames) < 1e-4
    with pytest.raises(FacesynthError, match="temperature=0"):
        runtime.stream()
