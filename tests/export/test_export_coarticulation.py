"""What speaks without torch speaks as the trained model does."""

import numpy as np
import pytest
from corpora import tiny_utterances

from facesynth.inference.errors import FacesynthError
from facesynth.inference.loading import load
from facesynth.methods.coarticulation.method import Coarticulation


@pytest.fixture(scope="module")
def pair(coarticulation_file, exported):
    return Coarticulation.load(coarticulation_file), load(exported(coarticulation_file))


def test_the_folder_speaks_as_the_model(pair, speeches):
    model, folder = pair
    assert len(folder.parts.models.triphone_keys)
    for speech in speeches:
        ours, theirs = model.synthesize(speech), folder.synthesize(speech, seed=3)
        assert theirs.fps == ours.fps
        assert theirs.frames == pytest.approx(ours.frames, abs=1e-3)


def test_lips_close_in_the_folder_too(pair):
    model, folder = pair
    assert folder.parts.closed_gap == pytest.approx(model.facts["closed_gap"])


def test_it_refuses_options_that_it_has_not(pair):
    with pytest.raises(FacesynthError, match="look_ahead"):
        pair[1].synthesize(tiny_utterances(1, 60)[0][1], look_ahead=3)


def test_fewer_bits_say_nearly_the_same(pair, coarticulation_file, exported, speeches):
    smaller = load(exported(coarticulation_file, "float16"))
    errors = [np.abs(smaller.synthesize(s).frames - pair[1].synthesize(s).frames).max() for s in speeches]
    assert max(errors) < 0.2
