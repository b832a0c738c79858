"""Maps of a trained model's own nodes."""

import numpy as np
import pytest
from corpora import tiny_corpus

from facesynth.corpus import parse_node
from facesynth.inference.errors import FacesynthError
from facesynth.methods.capabilities import Browsing
from facesynth.methods.registry import create, load, require


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    return tiny_corpus(tmp_path_factory.mktemp("maps") / "corpus", utterances=16, fps=60)


@pytest.fixture(scope="module")
def model(corpus):
    return create("efase").fit(corpus)


def test_every_frame_of_every_node_is_on_the_map_of_its_phone(model, corpus, tmp_path):
    model.save(tmp_path / "model.safetensors")
    kept = require(load(tmp_path / "model.safetensors"), Browsing)
    counted = 0
    for phone in kept.mapped_phones():
        found = kept.phone_map(phone)
        counted += len(found.plane.points)
        np.testing.assert_allclose(found.plane.points, found.placed(found.cluster.frames), atol=1e-2)
        for name, (before, after) in zip(found.cluster.names, found.cluster.contexts, strict=True):
            utterance, number = parse_node(name)
            said = ("pau", *corpus[utterance].speech.phones.labels, "pau")
            assert said[number : number + 3] == (before, phone, after)
    assert counted == len(model.nodes().frames)


def test_a_recorded_frame_is_picked_where_it_lies(model):
    found = model.phone_map("aa", "pca")
    picked, mixed = found.picked(found.plane.points[:20])
    wanted = found.cluster.decode(found.cluster.frames[:20].astype(np.float32))
    assert np.abs(picked - wanted).max() < 1.0
    assert mixed.inside.mean() > 0.5


def test_without_maps_they_are_made_when_asked_for(model, corpus):
    plain = create("efase", maps=False).fit(corpus)
    assert len(plain.map_points) == 0
    np.testing.assert_allclose(plain.phone_map("aa").plane.points, model.phone_map("aa").plane.points, atol=1e-3)
    with pytest.raises(FacesynthError, match="zh"):
        plain.phone_map("zh")
    with pytest.raises(FacesynthError, match="kind of map"):
        plain.phone_map("aa", "umap")
