import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from literal_search import literal
from scipy.interpolate import make_interp_spline, make_smoothing_spline
from scipy.ndimage import gaussian_filter1d
from scipy.signal import butter, sosfiltfilt

from facesynth.export.graph import difference
from facesynth.export.models import export_model
from facesynth.inference import FacesynthError, load
from facesynth.inference.efase import search as engine
from facesynth.inference.efase.assembly import smoothing_spline
from facesynth.inference.efase.bounds import step_bounds
from facesynth.inference.efase.costs import Query, Weights, all_targets
from facesynth.inference.efase.nodes import COLUMNS, Nodes
from facesynth.inference.efase.search import Search, SearchIndex
from facesynth.inference.efase.steps import path_cost, step_costs
from facesynth.inference.efase.stream import GUARD_S
from facesynth.inference.filters import butterworth, forth_and_back, gaussian, spline_at
from facesynth.inference.speech import EmotionTrack, Speech
from facesynth.methods.efase.method import Efase
from facesynth.methods.learn import expectation as prediction


@pytest.fixture(scope="module")
def pair(efase_file, exported):
    return Efase.load(efase_file), load(exported(efase_file))


def weakened(speech, intensity):
    track = speech.emotions
    return Speech(
        speech.audio, speech.sample_rate, speech.phones, EmotionTrack(track.labels, track.ends_s, track.intensities * intensity)
    )


def streamed(runtime, speech, **options):
    stream = runtime.stream(**options)
    feelings, amounts = speech.emotions.per_phone(speech.phones)
    pieces = [
        stream.push(*phone) for phone in zip(speech.phones.labels, speech.phones.ends_s, feelings, amounts.tolist(), strict=True)
    ]
    return np.concatenate([*pieces, stream.finish()]), sum(map(len, pieces))


@pytest.mark.parametrize("fps", [None, 25.0, 100.0])
@pytest.mark.parametrize("intensity", [1.0, 0.4])
def test_the_runtime_moves_as_torch_does(pair, speeches, fps, intensity):
    model, runtime = pair
    for speech in speeches:
        asked = weakened(speech, intensity)
        wanted, got = model.synthesize(asked, fps=fps), runtime.synthesize(asked, fps=fps)
        assert got.fps == wanted.fps
        assert difference(got.frames, wanted.frames) < 1e-5


def test_the_path_is_that_of_torch_or_a_tie(pair, speeches):
    model, runtime = pair
    for speech in speeches:
        wanted, got = model.plan(speech), runtime.plan(speech)
        assert got.cost == pytest.approx(wanted.cost, rel=1e-5, abs=1e-9)
        assert names_of(runtime, got.nodes) == names_of(model, wanted.nodes)


def names_of(model, path):
    names = model.names if hasattr(model, "names") else model.facts["names"]
    return [names[node] if node >= 0 else None for node in path]


@pytest.fixture(scope="module")
def doubled_pair(efase_file, tmp_path_factory):
    """A database that holds every node twice, in an order of its own and in two emotions that nobody will ask for."""
    model, rng, folder = Efase.load(efase_file), np.random.default_rng(7), tmp_path_factory.mktemp("doubled")
    table = model.node_table.numpy()
    count = table.shape[1]
    columns = dict(zip(COLUMNS, np.hstack([table, table]), strict=True))
    second = columns["before"][count:]
    second[second >= 0] += count
    columns["emotions"] = np.where(rng.permuted(np.arange(2 * count).reshape(2, -1), axis=0).ravel() < count, 1, 3)
    order = rng.permutation(2 * count)
    nodes = Nodes(model.node_frames.numpy(), **columns).take(order)
    names = [f"{name}{mark}" for mark in ("", "'") for name in model.facts["names"]]
    model.facts["names"] = [names[k] for k in order]
    model.node_table = torch.from_numpy(np.stack([getattr(nodes, name) for name in COLUMNS]))
    model._keep_bounds()
    model.save(folder / "model.safetensors")
    export_model(folder / "model.safetensors", folder / "exported")
    return Efase.load(folder / "model.safetensors"), load(folder / "exported")


@pytest.mark.parametrize("emotion", ["neutral", "sad", "happy"])
def test_of_nodes_that_cost_the_same_both_take_the_same(doubled_pair, speeches, emotion):
    model, runtime = doubled_pair
    for speech in speeches:
        track = EmotionTrack.constant(emotion, speech.phones.duration_s)
        asked = Speech(speech.audio, speech.sample_rate, speech.phones, track)
        assert names_of(runtime, runtime.plan(asked).nodes) == names_of(model, model.plan(asked).nodes)
        assert difference(runtime.synthesize(asked).frames, model.synthesize(asked).frames) < 1e-4


OTHERS = [
    {},  # the published ones
    {"alpha": 1.042, "beta": 0.3133, "eta": 0.1079, "gamma": 0.3088, "delta": 0.0636, "phi": 0.01373},  # found on one performer
    {"alpha": 2.124, "beta": 8.259, "eta": 7.027, "gamma": 0.3163, "delta": 1.078, "phi": 1.355},  # found on several corpora
    {"alpha": 0.3, "beta": 20.0, "eta": 0.05, "gamma": 1.0, "delta": 0.03, "phi": 1.0},
]


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 10_000), pnt=st.sampled_from([0.0, 0.5, 5.0, 500.0]), strict=st.booleans(), others=st.sampled_from(OTHERS)
)
def test_the_search_is_exact_on_random_databases(seed, pnt, strict, others):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(6, 60))
    lengths = rng.integers(1, 9, count)
    phones = rng.integers(0, 5, count)
    before = np.where(rng.random(count) < 0.7, np.arange(count) - 1, -1)
    pieces = [rng.standard_normal((n, 3)).astype(np.float32) for n in lengths]
    nodes = Nodes.from_pieces(pieces, phones, phones // 2, rng.integers(0, 2, count), before)
    weights = Weights(pnt, **others)
    wanted = rng.integers(0, 5, 8)
    strictly = np.full(8, strict) & np.isin(wanted // 2, nodes.visemes)
    fixed = {3: int(rng.integers(count))} if not strict else {}
    query = Query(wanted, wanted // 2, rng.integers(-1, 2, 8), fixed, strictly)
    index = SearchIndex(nodes, weights, step_bounds(nodes, weights))
    cost, _ = literal(nodes, query, weights)
    targets, step_by_step = all_targets(nodes, query, weights), Search(index)
    path = index.cheapest_path(targets)
    assert path_cost(nodes, query, path, weights) == pytest.approx(cost, rel=1e-9, abs=1e-9)
    for t in range(8):
        step_by_step.push(targets[t])
        so_far = query.part(np.arange(t + 1))
        least, _ = literal(nodes, so_far, weights)
        assert path_cost(nodes, so_far, step_by_step.path(), weights) == pytest.approx(least, rel=1e-9, abs=1e-9)
    require_the_best_ahead(index, nodes, targets, 2)


def require_the_best_ahead(index, nodes, targets, ahead):
    """Every settled node is on a cheapest path from the one before it; all steps of its window are computed."""
    every = np.arange(len(nodes))
    i, j = (grid.ravel() for grid in np.meshgrid(every, every, indexing="ij"))
    steps = step_costs(nodes, i, j, index.weights).reshape(len(nodes), -1)
    quest, path = Search(index), []
    for t, asked in enumerate(targets):
        quest.push(asked)
        if t < ahead:
            continue
        to_come = np.zeros(len(nodes))
        for target in targets[t : t - ahead : -1]:
            to_come = (steps + target + to_come).min(axis=1)
        whole = (steps[path[-1]] if path else 0.0) + targets[t - ahead] + to_come
        path.append(int(quest.trace(ahead + 1)[0]))
        quest.settle(path[-1], ahead)
        assert whole[path[-1]] == pytest.approx(whole.min(), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("look_ahead", [None, 1, 3])
@pytest.mark.parametrize("fps", [None, 25.0])
def test_phone_by_phone_gives_what_the_whole_gives(pair, speeches, look_ahead, fps):
    _, runtime = pair
    for intensity in (1.0, 0.5):
        speech = weakened(speeches[0], intensity)
        got, before_the_end = streamed(runtime, speech, look_ahead=look_ahead, weakened=intensity < 1, fps=fps)
        wanted = runtime.synthesize(speech, look_ahead=look_ahead, fps=fps).frames
        assert difference(got, wanted) < 1e-5
        assert look_ahead is None or before_the_end > 0


@pytest.mark.parametrize("look_ahead", [1, 3])
def test_the_three_hundredth_phone_costs_what_the_tenth_does(pair, speeches, look_ahead, monkeypatch):
    """Without a pause; counted in steps whose cost is computed, and in phones that are kept."""
    _, runtime = pair
    computed = []
    monkeypatch.setattr(engine, "step_costs", lambda nodes, i, *rest: computed.append(len(i)) or step_costs(nodes, i, *rest))
    spoken = [label for speech in speeches for label in speech.phones.labels if label != "pau"]
    stream, each = runtime.stream(look_ahead=look_ahead), []
    for t in range(300):
        computed.clear()
        stream.push(spoken[t % len(spoken)], 0.1 * (t + 1), "happy")
        each.append(sum(computed))
        assert all(len(stretch.search) <= look_ahead + 1 for stretch in stream._stretches)
    assert np.mean(each[-100:]) < 1.3 * np.mean(each[10:110])
    assert max(each[-100:]) < 1.5 * max(each[10:110])


def test_frames_come_as_soon_as_stated(pair, speeches):
    """With a look-ahead of n: n phones, the node after its own, and the guard."""
    _, runtime = pair
    stated = runtime.manifest["latency"]
    assert (stated["phones_after"], stated["guard_s"]) == (1, GUARD_S)
    ends, given, stream = speeches[0].phones.ends_s, 0, runtime.stream(look_ahead=2)
    for t, (label, end_s) in enumerate(zip(speeches[0].phones.labels, ends, strict=True)):
        given += len(stream.push(label, float(end_s), "neutral"))
        if t >= 4:
            assert given / runtime.fps >= ends[t - 4] - stated["guard_s"] - 1 / runtime.fps


def test_a_look_ahead_costs_no_less_than_the_whole(pair, speeches):
    _, runtime = pair
    for speech in speeches:
        assert runtime.plan(speech, look_ahead=1).cost >= runtime.plan(speech).cost * (1 - 1e-9)


def test_constraints_are_kept(pair, speeches):
    model, runtime = pair
    name = model.facts["names"][5]
    wanted, got = (m.plan(speeches[0], constraints={3: name}) for m in (model, runtime))
    assert runtime.names[got.nodes[3]] == name
    assert names_of(runtime, got.nodes) == names_of(model, wanted.nodes)
    for constraints, message in (({3: "nobody:1"}, "unknown node"), ({0: name}, "is silence"), ({99: name}, "no phone 99")):
        with pytest.raises(FacesynthError, match=message):
            runtime.plan(speeches[0], constraints=constraints)


def test_what_is_wrong_is_named(pair, speeches):
    _, runtime = pair
    with pytest.raises(FacesynthError, match="fps is -5"):
        runtime.synthesize(speeches[0], fps=-5)
    with pytest.raises(FacesynthError, match="look_ahead is 0"):
        runtime.synthesize(speeches[0], look_ahead=0)
    stream = runtime.stream()
    with pytest.raises(FacesynthError, match="unknown phone 'xx'"):
        stream.push("xx", 0.1, "happy")
    with pytest.raises(FacesynthError, match="unknown emotion 'bored'"):
        stream.push("aa", 0.1, "bored")
    stream.push("aa", 0.1, "happy")
    with pytest.raises(FacesynthError, match="wanted an end after 0.1 s"):
        stream.push("aa", 0.1, "happy")
    with pytest.raises(FacesynthError, match="weakened=True"):
        stream.push("aa", 0.2, "happy", 0.5)


SOFT = {
    "soft": {"audio_weight": 0.0, "pose_weight": 0.0, "expected_share": 0.0, "sharpening": 0.0, "candidates": 20},
    "softly heard": {},
    "heard": {"temperature": 0.0, "sharpening": 0.0},
}


@pytest.fixture(scope="module")
def soft_model(small_corpus):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(prediction, "STEPS", 5)  # how well it predicts does not matter here
        model = Efase(
            components=6, temperature=1.0, candidates=30, audio_weight=0.4, pose_weight=0.7, expected_share=0.3, sharpening=0.8
        ).fit(small_corpus)
    model.count_by(np.linspace(0.5, 1.5, len(model.audio.sound.size)), np.linspace(0.5, 2, 6))
    model.set_shares(np.stack([np.linspace(0.9, 0.2, 6), np.linspace(0.1, 0.9, 6)]).tolist())
    return model


@pytest.fixture(scope="module", params=SOFT)
def soft_pair(request, soft_model, tmp_path_factory):
    folder = tmp_path_factory.mktemp("soft")
    model = soft_model.with_weights(**SOFT[request.param])
    model.save(folder / "model.safetensors")
    export_model(folder / "model.safetensors", folder / "exported")
    return model, load(folder / "exported")


@pytest.mark.parametrize("intensity", [1.0, 0.4])
def test_means_over_paths_and_what_is_heard_are_those_of_torch(soft_pair, speeches, intensity):
    model, runtime = soft_pair
    for speech in speeches:
        asked = weakened(speech, intensity)
        wanted, got = model.plan(asked), runtime.plan(asked)
        assert got.cost == pytest.approx(wanted.cost, rel=1e-5, abs=1e-9)
        assert names_of(runtime, got.nodes) == names_of(model, wanted.nodes)
        assert difference(runtime.synthesize(asked).frames, model.synthesize(asked).frames) < 1e-4


def test_shares_of_components_are_those_of_torch(soft_pair):
    model, runtime = soft_pair
    if model.config["expected_share"] == 0:
        assert model.shares is None
        assert runtime.parts.shares is None
    else:
        np.testing.assert_array_equal(runtime.parts.shares, model.shares)


def test_a_model_that_looks_at_the_whole_does_not_stream(soft_pair, speeches):
    _, runtime = soft_pair
    for ask in (runtime.stream, lambda: runtime.synthesize(speeches[0], look_ahead=3)):
        with pytest.raises(FacesynthError, match="temperature=0"):
            ask()


def test_fewer_bits_are_smaller_and_move_nearly_the_same(efase_file, exported, pair, speeches):
    exact = pair[1].synthesize(speeches[0]).frames
    smaller = load(exported(efase_file, "float16"))
    assert np.abs(smaller.synthesize(speeches[0]).frames - exact).mean() < 0.1
    sizes = [(exported(efase_file, weights) / "arrays.npz").stat().st_size for weights in ("float32", "float16", "int8")]
    assert sizes[0] > 1.5 * sizes[1] > 1.5 * 1.2 * sizes[2]


@settings(max_examples=25, deadline=None)
@given(count=st.integers(1, 90), seed=st.integers(0, 999))
def test_filters_and_splines_are_scipys(count, seed):
    rng = np.random.default_rng(seed)
    signal = rng.standard_normal((count, 3))
    assert np.allclose(gaussian(signal[:, 0], 2.5), gaussian_filter1d(signal[:, 0], 2.5, mode="nearest"))
    if count < 2:
        return
    at = np.sort(rng.uniform(0, count - 1, 20))
    assert np.allclose(spline_at(signal, at), make_interp_spline(np.arange(count), signal, k=min(3, count - 1))(at))
    if count >= 5:
        weights = rng.uniform(0.5, 2, count)
        wanted = make_smoothing_spline(np.arange(count, dtype=float), signal, w=weights, lam=0.7)(np.arange(count))
        assert np.allclose(smoothing_spline(signal, weights, 0.7), wanted, atol=1e-7)
    cutoffs, reach = np.array([0.1, 0.3, 0.75]), np.minimum([20, 7, 3], count - 1)
    sections = np.moveaxis([butterworth(6, c) for c in cutoffs], 0, -1)
    wanted = [sosfiltfilt(butter(6, c, output="sos"), s, padlen=r) for c, s, r in zip(cutoffs, signal.T, reach, strict=True)]
    assert np.allclose(forth_and_back(sections, signal, reach), np.transpose(wanted), atol=1e-6)
