import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from facesynth.export.models import export_model
from facesynth.inference import FacesynthError, load
from facesynth.methods.emotion.clips import clips_of_corpus
from facesynth.methods.emotion.detector import DetectorSettings, EmotionDetector


@pytest.fixture(scope="module")
def pair(emotion_file, exported):
    return EmotionDetector.load(emotion_file), load(exported(emotion_file))


def test_features_probabilities_and_decisions_are_those_of_torch(pair, speeches):
    detector, runtime = pair
    for speech in speeches:
        wanted_features, features = (one.features(speech.audio, 16000) for one in (detector, runtime))
        assert np.allclose(features[:187], wanted_features[:187], rtol=1e-6, atol=1e-9)
        # The phone network works in float32, here by onnxruntime and there by torch: 2.8e-4 of values up to 9.8 was measured.
        assert np.allclose(features[187:], wanted_features[187:], atol=5e-4)
        wanted, got = detector.detect(speech.audio, 16000), runtime.detect(speech.audio, 16000)
        assert got.emotion == wanted.emotion
        assert got.probabilities == pytest.approx(wanted.probabilities, abs=3e-4)  # measured: 1.1e-4


@pytest.mark.parametrize("kernel", ["linear", "polynomial", "radial"])
def test_the_papers_features_and_every_kernel(small_corpus, speeches, tmp_path, kernel):
    detector = EmotionDetector(DetectorSettings(features="paper", coefficients=40, classifier="svm", kernel=kernel)).fit(
        clips_of_corpus(small_corpus)
    )
    detector.save(tmp_path / "paper.safetensors")
    export_model(tmp_path / "paper.safetensors", tmp_path / "folder")
    runtime = load(tmp_path / "folder")
    for speech in speeches:
        wanted = detector.detect(speech.audio, 16000)
        got = runtime.detect(speech.audio, 16000)
        assert got.emotion == wanted.emotion
        assert got.probabilities == pytest.approx(wanted.probabilities, rel=1e-4)


def test_a_track_is_that_of_torch(pair, long_sound, track_of_the_whole):
    wanted, got = pair[0].detect_track(*long_sound, window_s=1.0, hop_s=0.25), track_of_the_whole
    assert got.labels == wanted.labels
    assert np.allclose(got.ends_s, wanted.ends_s)


@pytest.fixture(scope="module")
def track_of_the_whole(pair, long_sound):
    return pair[1].detect_track(*long_sound, window_s=1.0, hop_s=0.25)


@settings(max_examples=5, deadline=None)
@given(sizes=st.lists(st.integers(1, 30000), min_size=1, max_size=8))
def test_pieces_of_any_size_give_the_track_of_the_whole(pair, long_sound, track_of_the_whole, sizes):
    sound, rate = long_sound
    stream, at = pair[1].stream(window_s=1.0, hop_s=0.25), 0
    for size in [*sizes, len(sound)]:
        for end_s, probabilities in stream.push(sound[at : at + size]):
            assert end_s <= (min(at + size, len(sound))) / rate + 1e-9
            assert sum(probabilities.values()) == pytest.approx(1)
        at += size
    got, wanted = stream.finish(), track_of_the_whole
    assert (got.labels, got.ends_s.tolist()) == (wanted.labels, wanted.ends_s.tolist())


def test_what_is_wrong_is_named(pair):
    _, runtime = pair
    with pytest.raises(FacesynthError, match="48000 Hz; wanted 16000 Hz"):
        runtime.stream(sample_rate=48000)
    with pytest.raises(FacesynthError, match="constant"):
        runtime.detect(np.zeros(16000, np.float32), 16000)
    with pytest.raises(FacesynthError, match="50 ms long"):
        runtime.detect(np.zeros(800, np.float32), 16000)
    with pytest.raises(FacesynthError, match=r"wanted float64 \['batch', 1051\]"):
        runtime(np.zeros((1, 5)))
    with pytest.raises(FacesynthError, match="no sound was pushed"):
        runtime.stream().finish()


@pytest.mark.parametrize(("weights", "harm", "size"), [("float16", 0.03, 0.6), ("int8", 0.25, 0.4)])
def test_fewer_bits_are_smaller_and_the_harm_is_small(pair, emotion_file, exported, speeches, weights, harm, size):
    exact, smaller = pair[1], load(exported(emotion_file, weights))
    for speech in speeches:
        wanted, got = exact.detect(speech.audio, 16000), smaller.detect(speech.audio, 16000)
        assert got.probabilities == pytest.approx(wanted.probabilities, abs=harm)
    sizes = [sum(path.stat().st_size for path in exported(emotion_file, kind).iterdir()) for kind in (weights, "float32")]
    assert sizes[0] < size * sizes[1]
    assert smaller.manifest["graphs"]["machine"]["parity"]["largest_relative_difference"] > 0
