from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facesynth.export.graph import difference
from facesynth.inference import FacesynthError, Resampler, load, resample
from facesynth.inference.speech import PhoneTrack, Speech
from facesynth.methods.lds.method import LDS
from facesynth.speech.audio import resample as facesynth_resample


@pytest.fixture(scope="module")
def pair(lds_file, exported):
    return LDS.load(lds_file), load(exported(lds_file))


@pytest.mark.parametrize("noise", [0.0, 1.0, 0.5])
def test_the_runtime_moves_as_torch_does(pair, speeches, noise):
    model, runtime = pair
    for seed, speech in enumerate(speeches):
        wanted = model.synthesize(speech, seed=seed, noise=noise)
        got = runtime.synthesize(speech, seed=seed, noise=noise)
        assert difference(got.frames, wanted.frames) < 1e-5
        assert (got.fps, got.layout.names, len(got)) == (wanted.fps, wanted.layout.names, len(wanted))


@pytest.mark.parametrize("rate", [8000, 11025, 22050, 44100, 48000])
def test_sound_of_any_rate(pair, speeches, rate):
    model, runtime = pair
    speech = speeches[0]
    other = Speech(facesynth_resample(speech.audio, 16000, rate), rate, speech.phones, speech.emotions)
    assert difference(resample(other.audio, rate, 16000), facesynth_resample(other.audio, rate, 16000)) < 1e-6
    assert difference(runtime.synthesize(other).frames, model.synthesize(other).frames) < 1e-5


@settings(max_examples=8, deadline=None)
@given(sizes=st.lists(st.integers(1, 6000), min_size=1, max_size=12), seed=st.integers(0, 99))
def test_pieces_of_any_size_give_what_the_whole_gives(pair, speeches, sizes, seed):
    _, runtime = pair
    speech = speeches[seed % len(speeches)]
    speech = replace(speech, phones=PhoneTrack(("pau",), speech.phones.ends_s[-1:]))  # a stream of sound knows none
    wanted = runtime.synthesize(speech, seed=seed).frames
    stream, pieces, at = runtime.stream(seed=seed), [], 0
    for size in [*sizes, len(speech.audio)]:
        pieces.append(stream.push(speech.audio[at : at + size]))
        at += size
    got = np.concatenate([*pieces, stream.finish()])
    assert abs(len(got) - len(wanted)) <= 1  # the phone track rounds seconds, the stream rounds samples
    count = min(len(got), len(wanted))
    assert difference(got[:count], wanted[:count]) < 1e-5


@settings(max_examples=40, deadline=None)
@given(
    rate=st.sampled_from([8000, 11025, 16000, 22050, 44100, 48000]),
    new_rate=st.sampled_from([16000, 22050, 8000]),
    length=st.integers(0, 5000),
    sizes=st.lists(st.integers(0, 900), max_size=12),
)
def test_resampled_pieces_are_the_resampled_whole(rate, new_rate, length, sizes):
    sound = np.random.default_rng(length).standard_normal(length).astype(np.float32)
    resampler, pieces, at = Resampler(rate, new_rate), [], 0
    for size in [*sizes, length]:
        pieces.append(resampler.push(sound[at : at + size]))
        at += size
        heard_s, given_s = min(at, length) / rate, sum(map(len, pieces)) / new_rate
        assert given_s >= heard_s - resampler.look_ahead_s - 2 / min(rate, new_rate)
    got, wanted = np.concatenate([*pieces, resampler.finish()]), resample(sound, rate, new_rate)
    assert got.shape == wanted.shape
    assert np.array_equal(got, wanted)
    with pytest.raises(FacesynthError, match="was finished"):
        resampler.push(sound)


def test_the_torch_model_streams_as_its_export_does(pair, speeches):
    sound, streams = speeches[0].audio, [model.stream(seed=3) for model in pair]
    got, wanted = (np.concatenate([s.push(sound[:4000]), s.push(sound[4000:]), s.finish()]) for s in streams)
    assert len(got) > 20
    assert difference(got, wanted) < 1e-5
    with pytest.raises(FacesynthError, match="was finished"):
        streams[0].push(sound)


def test_sound_of_44100_hz_is_streamed(pair, speeches):
    _, runtime = pair
    sound = facesynth_resample(speeches[0].audio, 16000, 44100)
    resampler, stream = Resampler(44100, 16000), runtime.stream(seed=2)
    pieces = [stream.push(resampler.push(sound[at : at + 441])) for at in range(0, len(sound), 441)]
    got = np.concatenate([*pieces, stream.push(resampler.finish()), stream.finish()])
    other = runtime.stream(seed=2)
    wanted = np.concatenate([other.push(resample(sound, 44100, 16000)), other.finish()])
    assert difference(got, wanted) < 1e-6


def test_one_sample_at_a_time_and_the_stated_latency(pair, speeches):
    _, runtime = pair
    sound = speeches[0].audio[:6000]
    stream, frames = runtime.stream(), []
    for k in range(len(sound)):
        for frame in stream.push(sound[k : k + 1]):
            late_s = (k + 1) / 16000 - len(frames) / runtime.fps
            assert late_s <= runtime.look_ahead_s + 1 / 16000
            frames.append(frame)
    rest = stream.finish()
    assert len(frames) > 3
    whole = runtime.stream()
    again = np.concatenate([whole.push(sound), whole.finish()])
    assert difference(np.concatenate([frames, rest]), again) < 1e-6


def test_a_state_is_kept_and_taken_up_again(pair, speeches):
    _, runtime = pair
    sound = speeches[1].audio
    stream = runtime.stream(seed=4)
    first = stream.push(sound[:5000])
    kept = stream.state
    second = stream.push(sound[5000:])
    again, _ = runtime.advance(kept, sound[5000:])
    assert np.array_equal(second, again)
    assert len(first)


def test_what_is_wrong_is_named(pair, speeches):
    _, runtime = pair
    with pytest.raises(FacesynthError, match="44100 Hz; wanted 16000 Hz"):
        runtime.stream(sample_rate=44100)
    with pytest.raises(FacesynthError, match="noise is -1"):
        runtime.synthesize(speeches[0], noise=-1)
    with pytest.raises(FacesynthError, match="look_ahead"):
        runtime.synthesize(speeches[0], look_ahead=3)
    with pytest.raises(FacesynthError, match=r"float32 \[1, 5, 3\]; wanted float32 \['batch', 'frames', 4\]"):
        runtime.rollout(
            features=np.zeros((1, 5, 3), np.float32),
            innovations=np.zeros((1, 5, 4), np.float32),
            state=np.zeros((1, 4), np.float32),
        )
    with pytest.raises(FacesynthError, match="innovations is float32"):
        runtime.rollout(
            features=np.zeros((1, 5, 4), np.float32),
            innovations=np.zeros((1, 6, 4), np.float32),
            state=np.zeros((1, 4), np.float32),
        )
    with pytest.raises(FacesynthError, match="state is nothing"):
        runtime.rollout(features=np.zeros((1, 5, 4), np.float32), innovations=np.zeros((1, 5, 4), np.float32))


def test_fewer_bits_are_smaller_and_the_harm_is_stated(lds_file, exported, pair, speeches):
    exact = pair[1].synthesize(speeches[0], noise=0.0).frames
    moved = np.abs(exact - exact.mean(axis=0)).max()
    sizes = {}
    for weights, harm in (("float16", 0.02), ("int8", 0.3)):
        folder = exported(lds_file, weights)
        sizes[weights] = sum(path.stat().st_size for path in folder.iterdir())
        smaller = load(folder)
        assert 0 < smaller.manifest["graphs"]["features"]["parity"]["largest_relative_difference"] < 1
        assert np.abs(smaller.synthesize(speeches[0], noise=0.0).frames - exact).max() < harm * moved
    full = sum(path.stat().st_size for path in exported(lds_file).iterdir())
    assert sizes["int8"] < 0.35 * full < sizes["float16"] < 0.6 * full
