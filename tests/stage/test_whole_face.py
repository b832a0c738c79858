"""Mouth, head and eyes of several models make one face, and it says who moves what."""

from dataclasses import replace

import numpy as np
import pytest
from corpora import tiny_layout, tiny_utterances
from living_eyes import learnt, recording

from facesynth.face.behaviour.eyes import still_eyes
from facesynth.inference.eyes import at_rest
from facesynth.inference.layout import Layout
from facesynth.stage.cast import Cast
from facesynth.stage.request import Part, Request
from facesynth.stage.whole_face import EYES, HEAD, packaged_eyes, whole_face
from facesynth.zoo.shelf import entry, load


class Mouth:
    """A mouth that only has a name here."""

    name, path = "mouth", None


@pytest.fixture(scope="module")
def speech():
    return tiny_utterances(1, 60, seed=3)[0][1]


@pytest.fixture(scope="module")
def motion(speech):
    return at_rest(tiny_layout(), int(speech.phones.frame_bounds(60)[-1]), 60.0)


@pytest.fixture(scope="module")
def eyes():
    return learnt(recording(seed=1))


def face(motion, speech, mover=None, **parts):
    return whole_face(Cast(Mouth(), eyes=mover), motion, speech, Request(**parts))


def test_eyes_of_a_model_go_with_the_head_as_it_is_shown(motion, speech, eyes):
    nodding = replace(motion, head=recording(len(motion) / 60).head[: len(motion)])
    for gain in (0.5, 2.0):
        made = face(nodding, speech, eyes, head=Part(gain=gain))
        shown = replace(motion, head=gain * nodding.head)
        assert made.motion.eyes == pytest.approx(eyes.look(shown).eyes, abs=1e-6)
        assert made.motion.head == pytest.approx(eyes.look(shown).head, abs=1e-6)
    assert made.sources["head"] == "as the mouth's model recorded it"
    assert made.sources["eyes"].startswith("eyes: patches ")


def test_a_part_that_is_off_is_still_whoever_else_moves(motion, speech, eyes):
    nodding = replace(motion, head=recording(len(motion) / 60).head[: len(motion)])
    made = face(nodding, speech, eyes, head=Part("off"))
    assert made.motion.head is None
    assert made.sources["head"] == "off"
    without = face(nodding, speech, eyes, eyes=Part("off"))
    assert without.eyes is still_eyes
    assert without.motion.eyes is None


def test_what_nobody_recorded_is_named_as_what_it_is(motion, speech):
    made = face(motion, speech)
    assert "constants" in made.sources["head"] or "package" in made.sources["head"]
    assert "package" in made.sources["eyes"]
    still = face(motion, speech, head=Part("recorded"), eyes=Part("recorded"))
    assert still.motion.head is None
    assert still.eyes is still_eyes
    assert "still" in still.sources["head"]


def test_the_packages_head_follows_the_packages_eyes_and_no_other_does(speech):
    motion = at_rest(tiny_layout(), 120 * 60, 60.0)
    followed, alone = face(motion, speech), face(motion, speech, eyes=Part("off"))
    assert np.degrees(np.abs(followed.motion.head - alone.motion.head)[:, 1]).max() > 3
    for held in ({"head": Part("off")}, {"head": Part("recorded")}, {"head": Part(gain=0.0)}):
        assert face(motion, speech, **held).eyes is packaged_eyes
    own = replace(motion, head=np.full((len(motion), 6), 0.01, np.float32))
    assert np.array_equal(face(own, speech).motion.head, own.head)
    curves = at_rest(Layout("curves", ("jawOpen", "eyeLookInLeft")), 60, 60.0)
    assert face(curves, speech).eyes is packaged_eyes, "these show where they look"


def test_eyes_beside_a_head_that_is_held_make_the_whole_shift(motion, speech, eyes):
    made = face(motion, speech, eyes, head=Part("off"))
    assert made.motion.eyes == pytest.approx(eyes.look(replace(motion, head=None), turning=0.0).eyes, abs=1e-6)


def test_the_packages_eyes_live_and_say_from_whom_they_are():
    found = entry(EYES)
    assert found.part == "eyes"
    assert found.size_bytes < 2e6
    provenance = load(EYES).provenance
    assert len(provenance["sources"]) == len(provenance["licences"]) == 3
    made = packaged_eyes(np.zeros((60 * 60, 6)), 60.0, None, 0)
    assert ((made[1:, 0] < 0.2) & (made[:-1, 0] >= 0.2)).sum() in range(8, 35)
    assert np.median(made[:, 0]) > 0.95, "between blinks the lids are open"
    assert 0.5 < np.degrees(made[:, 1:].std(axis=0)).min() < np.degrees(made[:, 1:].std(axis=0)).max() < 12


def test_the_packages_head_turns_as_people_do_and_says_from_whom_it_is(speech):
    found = entry(HEAD)
    assert found.part == "head"
    licences = [licence for source in load(HEAD).provenance["sources"] for licence in source["licences"]]
    assert len(licences) == 2
    assert all(licences)
    head = load(HEAD).synthesize(speech).head
    assert 0.2 < np.degrees(np.linalg.norm(head[:, :3].std(axis=0))) < 10
