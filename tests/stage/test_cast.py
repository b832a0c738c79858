"""Head and eyes of models of their own, beside the mouth."""

from pathlib import Path

import numpy as np
import pytest

from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.stage.request import Part
from facesynth.stage.whole_face import at_clock

LAYOUT = Layout("curves", ("jawOpen",))


def nodding(count, fps):
    head = np.zeros((count, 6), np.float32)
    head[:, 0] = 0.1 * np.sin(2 * np.pi * np.arange(count) / fps)
    return Motion(np.zeros((count, 1), np.float32), fps, LAYOUT, head)


@pytest.mark.parametrize("count", [75, 74, 77])
def test_a_head_comes_to_the_clock_of_the_mouth(count):
    mouth = Motion(np.zeros((count, 1), np.float32), 25.0, LAYOUT)
    there = at_clock(nodding(360, 120.0), mouth)
    assert there.head.shape == (count, 6)
    assert there.eyes is None
    np.testing.assert_allclose(there.head[:74, 0], 0.1 * np.sin(2 * np.pi * np.arange(74) / 25), atol=1e-3)


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("off", Part("off")),
        ("recorded", Part("recorded")),
        ("0.5", Part(gain=0.5)),
        ("head.safetensors", Part("model", model=Path("head.safetensors"))),
        ("knn:a/head.safetensors", Part("model", model=Path("a/head.safetensors"), method="knn")),
        ("C:\\a\\head.safetensors", Part("model", model=Path("C:\\a\\head.safetensors"))),
        ("head_hmm:head.safetensors:0.7", Part("model", 0.7, Path("head.safetensors"), "head_hmm")),
    ],
)
def test_who_moves_a_part_is_said_in_a_word(text, part):
    assert Part.of(text) == part


@pytest.mark.parametrize("wrong", [{"source": "model"}, {"source": "off", "model": Path("a")}, {"gain": -1.0}])
def test_a_part_that_cannot_be_is_refused(wrong):
    with pytest.raises(FacesynthError):
        Part(**wrong)
