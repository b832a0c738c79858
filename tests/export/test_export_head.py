import numpy as np
import pytest
from nodding import nodding, nodding_corpus

from facesynth.inference import load
from facesynth.inference.head.keys import HeadKeys
from facesynth.methods.head_hmm.method import HeadHmmMethod
from facesynth.methods.head_knn.method import HeadKnnMethod
from facesynth.methods.registry import load as load_method


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("heads")
    corpus = nodding_corpus(folder / "corpus", 6)
    HeadKnnMethod(near=0.3, rough=0.4, away=0.3).fit(corpus).save(folder / "knn.safetensors")
    HeadHmmMethod(clusters=6).fit(corpus).save(folder / "hmm.safetensors")
    return folder


@pytest.mark.parametrize("name", ["knn", "hmm"])
def test_the_runtime_moves_the_head_as_torch_does(name, files, exported):
    model, runtime = load_method(files / f"{name}.safetensors"), load(exported(files / f"{name}.safetensors"))
    for number in (50, 51):
        speech, _ = nodding(number)
        wanted, got = model.synthesize(speech, seed=number), runtime.synthesize(speech, seed=number)
        np.testing.assert_allclose(got.head, wanted.head, atol=2e-5)
        np.testing.assert_array_equal(got.frames, wanted.frames)
        assert got.fps == wanted.fps


def test_the_runtime_takes_key_poses_and_streams(files, exported):
    model, runtime = load_method(files / "knn.safetensors"), load(exported(files / "knn.safetensors"))
    speech, _ = nodding(52)
    keys = HeadKeys(np.array([1.0]), np.full((1, 6), 0.1))
    np.testing.assert_allclose(
        runtime.synthesize(speech, head_keys=keys).head, model.synthesize(speech, head_keys=keys).head, atol=2e-5
    )
    stream = runtime.stream(look_ahead_s=np.inf, keys=keys)
    got = np.concatenate([stream.push(speech.audio[:9000]), stream.push(speech.audio[9000:]), stream.finish()])
    np.testing.assert_allclose(got, runtime.synthesize(speech, head_keys=keys).head, atol=1e-5)
