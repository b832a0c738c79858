import numpy as np
import pytest
from facesynth_runtime import RuntimeInputError, load
from facesynth_runtime.anime_graph.hearing import audio_costs, warp_path
from hypothesis import given, settings
from hypothesis import strategies as st

from facesynth.export.graph import difference
from facesynth.export.models import export_model
from facesynth.methods.anime_graph.audio_cost import audio_costs as torch_costs
from facesynth.methods.anime_graph.audio_cost import warp_path as torch_path
from facesynth.methods.anime_graph.method import AnimeGraph
from facesynth.methods.efase import prediction
from facesynth.speech.speech import EmotionTrack, Speech


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


def test_emotions_are_mapped_as_by_torch(pair, speeches):
    model, runtime = pair
    assert len(runtime.pairs)
    source, target = (model.emotions[k] for k in runtime.pairs[0])
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


def test_frames_come_before_the_end(pair, speeches):
    _, runtime = pair
    stream, given = runtime.stream(look_ahead=1), []
    stream.hear(speeches[0].audio)
    for label, end_s in zip(speeches[0].phones.labels, speeches[0].phones.ends_s, strict=True):
        given.append(len(stream.push(label, float(end_s), "neutral")))
    assert sum(given) > 0
    assert sum(given) / runtime.fps >= speeches[0].phones.ends_s[-6] - 0.8 - 0.15 - 2 / runtime.fps


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 9999))
def test_warps_are_those_of_facesynth(seed):
    rng = np.random.default_rng(seed)
    lengths = rng.integers(1, 15, 9)
    stops, features = np.cumsum(lengths), rng.standard_normal((int(lengths.sum()), 4))
    wanted = rng.standard_normal((int(rng.integers(1, 12)), 4))
    assert np.allclose(
        audio_costs(wanted, features, stops - lengths, stops), torch_costs(wanted, features, stops - lengths, stops)
    )
    assert np.array_equal(warp_path(wanted, features[:7]), torch_path(wanted, features[:7]))


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
    with pytest.raises(RuntimeInputError, match="8000 Hz; wanted 16000 Hz"):
        runtime.stream(sample_rate=8000)
    with pytest.raises(RuntimeInputError, match="look_ahead is 0"):
        runtime.stream(look_ahead=0)
    with pytest.raises(RuntimeInputError, match="unknown emotion 'bored'"):
        runtime.synthesize(speeches[0], to_emotion="bored")
    with pytest.raises(RuntimeInputError, match="intensity is 2"):
        runtime.synthesize(speeches[0], to_emotion="happy", to_intensity=2)
    with pytest.raises(RuntimeInputError, match="wanted sound"):
        runtime.stream().finish()
    silent = Speech(np.zeros(16000, np.float32), 16000, speeches[0].phones, speeches[0].emotions)
    with pytest.raises(RuntimeInputError, match="constant"):
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
    with pytest.raises(RuntimeInputError, match="temperature=0"):
        runtime.stream()
