"""What feels without torch feels as the trained model does."""

import numpy as np
import pytest

from facesynth.inference.loading import load
from facesynth.inference.speech import EmotionTrack, Speech
from facesynth.methods.expression.method import Expression


def sad(speech, intensity=1.0):
    return Speech(speech.audio, speech.sample_rate, speech.phones, EmotionTrack.constant("sad", speech.duration_s, intensity))


def test_the_folder_adds_what_the_model_adds(expression_file, exported, speeches):
    model, folder = Expression.load(expression_file), load(exported(expression_file))
    assert folder.emotions == model.emotions
    for speech in speeches:
        still = model.synthesize(sad(speech, 0.0))
        ours, theirs = (one.express(still, sad(speech), seed=5).frames for one in (model, folder))
        assert theirs == pytest.approx(ours, abs=1e-3)
        assert np.abs(theirs - still.frames).max() > 1
        assert folder.express(still, sad(speech, 0.0)).frames.tobytes() == still.frames.tobytes()
