"""An exported folder moves eyes as the trained model does."""

import numpy as np
import pytest
from corpora import tiny_layout

from facesynth.inference.errors import FacesynthError
from facesynth.inference.eyes import at_rest
from facesynth.inference.loading import load
from facesynth.methods.eyes.method import Eyes


def test_the_folder_moves_eyes_as_the_model(eyes_file, exported, speeches):
    model, folder = Eyes.load(eyes_file), load(exported(eyes_file))
    for speech in speeches:
        ours, theirs = model.synthesize(speech, seed=4), folder.synthesize(speech, seed=4)
        assert np.array_equal(ours.eyes, theirs.eyes)
        assert np.array_equal(ours.head, theirs.head)
    still = at_rest(tiny_layout(), 300, 25.0)
    assert np.array_equal(model.look(still, seed=1).eyes, folder.look(still, seed=1).eyes)


def test_it_refuses_options_that_it_has_not(eyes_file, exported, speeches):
    with pytest.raises(FacesynthError, match="look_ahead"):
        load(exported(eyes_file)).synthesize(speeches[0], look_ahead=3)
