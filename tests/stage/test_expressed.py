"""Expressions of one performer on the mouth of another, by the shapes of the head that both have in common."""

import numpy as np
import pytest
from corpora import tiny_utterances

from facesynth.face.rig.anny import head_folder
from facesynth.face.rig.arkit_rig import load_head
from facesynth.face.rig.markers import LipGap
from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.inference.speech import EmotionTrack, Speech
from facesynth.motion.arkit_names import ARKIT_NAMES
from facesynth.motion.planar import tracked_layout
from facesynth.stage.cast import cast_for
from facesynth.stage.expressed import expressed
from facesynth.stage.request import Request
from facesynth.zoo.shelf import load

FELT = ("browInnerUp", "mouthFrownLeft", "jawOpen")
RESTING, SAD = np.array([0.1, 0.0, 0.2]), np.array([0.6, 0.4, 0.5])


@pytest.fixture(autouse=True)
def needs_the_head():
    try:
        head_folder()
    except FacesynthError as error:
        pytest.skip(str(error))


class Feeling:
    """A model of expressions of three curves: at rest, or sad as strongly as it is felt."""

    capabilities = type("stated", (), {"name": "feeling", "abilities": frozenset()})
    name, fitted_layout = "feeling", Layout("curves", FELT)

    def synthesize(self, speech, *, seed=0):
        amount = speech.emotions.intensities[0] if "sad" in speech.emotions.labels else 0.0
        pose = RESTING + amount * (SAD - RESTING)
        return Motion(np.tile(pose.astype(np.float32), (round(speech.duration_s * 60), 1)), 60.0, self.fitted_layout)

    def express(self, motion, speech, *, seed=0):
        if motion.layout.names != FELT:
            raise FacesynthError("this model adds expressions to motion of its own layout")
        return motion


def feels(amount, emotion="sad"):
    said = tiny_utterances(1, 60)[0][1]
    return Speech(said.audio, said.sample_rate, said.phones, EmotionTrack.constant(emotion, said.duration_s, amount))


def mouth(count=30):
    """A mouth that opens and shuts, by ARKit's curves."""
    frames = np.zeros((count, 52), np.float32)
    frames[:, ARKIT_NAMES.index("jawOpen")] = 0.2 + 0.2 * np.sin(np.arange(count))
    frames[::3, ARKIT_NAMES.index("mouthClose")] = frames[::3, ARKIT_NAMES.index("jawOpen")]
    return Motion(frames, 25.0, Layout("curves", ARKIT_NAMES))


def column(motion, name):
    return motion.frames[:, motion.layout.names.index(name)]


@pytest.mark.parametrize("amount", [0.5, 1.0])
def test_what_a_feeling_adds_to_its_own_face_is_added_to_the_other(amount):
    plain, felt = mouth(), expressed(Feeling(), mouth(), feels(amount))
    assert column(felt, "browInnerUp") == pytest.approx(amount * 0.5, abs=1e-3)
    assert column(felt, "mouthFrownLeft") == pytest.approx(amount * 0.4, abs=1e-3)
    assert column(felt, "jawOpen") == pytest.approx(column(plain, "jawOpen") + amount * 0.3, abs=1e-3)
    assert felt.layout.names == ARKIT_NAMES


def test_lips_that_touch_still_touch():
    lips, plain = LipGap.of(load_head()), mouth()
    before, after = (lips.opening_mm(one.frames) for one in (plain, expressed(Feeling(), plain, feels(1.0))))
    shut = before < 0.7
    assert shut.any()
    assert after[shut] == pytest.approx(before[shut], abs=0.3)
    assert (after[before > 3] > before[before > 3]).all(), "the feeling opens a mouth that is open"


@pytest.mark.parametrize("speech", [feels(0.0), feels(1.0, "neutral")])
def test_a_face_that_feels_nothing_stays_as_it_is(speech):
    plain = mouth()
    assert expressed(Feeling(), plain, speech) is plain


def test_real_faces_in_video_and_curves_of_ones_own_are_refused():
    still = np.zeros((30, 2 * 478), np.float32)
    with pytest.raises(FacesynthError, match="its own layout"):
        expressed(Feeling(), Motion(still, 25.0, tracked_layout(478)), feels(1.0))
    with pytest.raises(FacesynthError, match="this mouth moves other curves"):
        expressed(Feeling(), Motion(still[:, :2], 25.0, Layout("curves", ("a", "b"))), feels(1.0))


def test_the_expressions_of_the_package_are_found_by_name_and_felt_by_a_real_talkers_mouth():
    request = Request(expression="expressions", emotion="sad")
    sad, calm = (cast_for(load("grid-s1"), request).motion(feels(amount), request, {}) for amount in (1.0, 0.0))
    assert (calm.layout.kind, sad.layout.names) == ("markers", ARKIT_NAMES)
    assert column(sad, "browInnerUp").mean() > 0.2
    with pytest.raises(FacesynthError, match="unknown model"):
        cast_for(load("grid-s1"), Request(expression="expresions", emotion="sad"))
