"""What the regressions may hear: log-mel bands, the phone network's hidden layer, or both."""

import numpy as np
import pytest
from corpora import tiny_corpus

from facesynth.inference.errors import FacesynthError
from facesynth.methods.baselines.ridge import NARROW, TIMES, WIDE_TIMES, Ridge
from facesynth.methods.baselines.tcn import Tcn
from facesynth.methods.learn.hearing import BANDS, HIDDEN_LAYER, WIDTHS, Hearing
from facesynth.speech.phone_archive import is_installed

needs_weights = pytest.mark.skipif(not is_installed(), reason="the weights that phones are heard with are not installed")


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("tiny") / "corpus", utterances=8, fps=60)


@needs_weights
@pytest.mark.parametrize("features", list(WIDTHS))
def test_features_are_standardised_and_hundred_times_a_second(corpus, features):
    hearing = Hearing(features)
    hearing.learn(corpus)
    speech = next(iter(corpus)).speech
    bands = hearing.bands(speech)
    assert bands.shape == (1 + int(speech.duration_s * 100 + 1e-6), WIDTHS[features])
    every = np.concatenate([hearing.at(u.speech, np.arange(len(hearing.bands(u.speech))) / 100).numpy() for u in corpus])
    np.testing.assert_allclose(every.mean(axis=0), 0, atol=1e-3)
    assert np.percentile(every.std(axis=0), 50) == pytest.approx(1, abs=1e-2)


@needs_weights
def test_both_are_one_beside_the_other(corpus):
    speech = next(iter(corpus)).speech
    apart = [Hearing(features).bands(speech) for features in ("log_mel", "phone_net")]
    np.testing.assert_array_equal(Hearing("both").bands(speech), np.hstack(apart))


@needs_weights
def test_a_model_keeps_what_it_hears_with(corpus, tmp_path):
    model = Tcn(steps=3, features="phone_net").fit(corpus, seed=0)
    speech = next(iter(corpus)).speech
    model.save(tmp_path / "m.safetensors")
    again = Tcn.load(tmp_path / "m.safetensors")
    np.testing.assert_array_equal(again.synthesize(speech).frames, model.synthesize(speech).frames)


@needs_weights
def test_a_model_hears_with_the_layer_that_it_learned_with(corpus, tmp_path):
    model = Ridge(features="phone_net").fit(corpus, seed=0)
    speech = next(iter(corpus)).speech
    model.save(tmp_path / "m.safetensors")
    assert int(Ridge.load(tmp_path / "m.safetensors").hearing.layer) == HIDDEN_LAYER
    model.hearing.layer -= 1
    model.save(tmp_path / "other.safetensors")
    other = Ridge.load(tmp_path / "other.safetensors")
    assert not np.array_equal(other.hearing.bands(speech), Ridge.load(tmp_path / "m.safetensors").hearing.bands(speech))


@needs_weights
def test_wide_features_are_heard_by_their_principal_components_and_narrow_ones_as_they_are(corpus, tmp_path):
    wide, bands = Ridge().fit(corpus, seed=0), Ridge(features="log_mel").fit(corpus, seed=0)
    assert (len(wide.weights), len(bands.weights)) == (WIDE_TIMES * NARROW, TIMES * BANDS)
    speech = next(iter(corpus)).speech
    wide.save(tmp_path / "m.safetensors")
    assert np.array_equal(Ridge.load(tmp_path / "m.safetensors").synthesize(speech).frames, wide.synthesize(speech).frames)
    wide.narrow, wide.weights = bands.narrow, wide.weights.new_zeros(TIMES * WIDTHS["both"], wide.weights.shape[1])
    as_before = wide.synthesize(speech).frames
    np.testing.assert_allclose(as_before, np.broadcast_to(as_before[0], as_before.shape), rtol=1e-5)


def test_unknown_features_are_refused():
    with pytest.raises(FacesynthError, match="phone_net"):
        Ridge(features="phone_nets")
