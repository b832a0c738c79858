"""How far lips are apart where p, b and m shut them, and that whatever moves a real face shuts them as far."""

from dataclasses import replace

import numpy as np
import pytest

from facesynth.corpus import Corpus, Record
from facesynth.face.texture.speaker import Speaker
from facesynth.inference.lips import gap
from facesynth.inference.motion import Motion
from facesynth.inference.speech import EmotionTrack, PhoneTrack, Speech
from facesynth.motion.planar import inner_outline, motion_frames, picture_points, tracked_layout
from facesynth.stage.speaker_pictures import closed_at_phones, pressed_pictures, shut_lips

FPS, RATE = 25.0, 16_000
LAYOUT = tracked_layout(4, mouth=True)
PHONES = PhoneTrack(("pau", "m", "aa", "b", "aa"), np.array([0.4, 0.6, 1.2, 1.36, 2.0]))
LOWER = [*LAYOUT.group("lower_lip"), *LAYOUT.group("jaw")]


def mouth(openings):
    """[T, K, 2] px, y down: both inner lips on one line, the lower lip and the jaw that many px below it."""
    points = np.random.default_rng(0).uniform(0, 60, (len(LAYOUT.names), 2))
    outline = inner_outline(LAYOUT)
    points[outline[:11]] = np.column_stack([np.linspace(0, 50, 11), np.full(11, 30.0)])
    points[outline[11:]] = np.column_stack([np.linspace(45, 5, 9), np.full(9, 30.0)])
    shapes = np.repeat(points[None], len(openings), axis=0)
    shapes[:, LOWER, 1] += np.asarray(openings)[:, None]
    return shapes


def spoken(narrowest):
    """A motion that is 9 px open but in the middle of m and of b."""
    openings = np.full(50, 9.0)
    openings[[12, 32]] = narrowest
    return Motion(motion_frames(mouth(openings)), FPS, LAYOUT)


@pytest.fixture
def corpus(tmp_path):
    corpus = Corpus.create(tmp_path / "c", performer="p", layout=LAYOUT, fps=FPS, emotions=("neutral",))
    speech = Speech(np.zeros(2 * RATE, np.float32), RATE, PHONES, EmotionTrack.constant("neutral", 2.0))
    corpus.add_utterance(Record("a", sentence="a"), speech, spoken([2.0, 3.0]))
    corpus.add_utterance(Record("b", sentence="b"), speech, spoken([3.0, 8.0]))
    return corpus


def test_the_median_of_the_narrowest_moments_counts(corpus):
    np.testing.assert_allclose(shut_lips(corpus), np.full(9, 3.0), atol=1e-4)


def test_pictures_of_pressed_lips_are_the_narrowest_of_what_shuts_them(corpus):
    found = pressed_pictures(corpus, {"b": 50, "a": 50})
    assert np.flatnonzero(found).tolist() == [12, 62, 82]  # b stays 8 px open in its second one


def test_where_nobody_says_one_nothing_is_known(corpus):
    speech = corpus["a"].speech
    open_all_along = replace(speech, phones=PhoneTrack(("aa",), np.array([2.0])))
    others = Corpus.create(corpus.path.parent / "d", performer="p", layout=LAYOUT, fps=FPS, emotions=("neutral",))
    others.add_utterance(Record("a", sentence="a"), open_all_along, spoken([2.0, 2.0]))
    assert len(shut_lips(others)) == 0
    assert not pressed_pictures(others, {"a": 50}).any()


def test_lips_and_jaw_shut_at_each_of_them(corpus):
    speaker = speaker_like(mouth(np.linspace(3, 12, 40)), shut_lips(corpus))
    before = spoken([7.0, 2.0])
    after = closed_at_phones(before, PHONES, speaker)
    openings = gap(after.frames, LAYOUT)
    assert openings[12] == pytest.approx(3.0, abs=0.01)  # m: it was open
    assert openings[32] == pytest.approx(2.0, abs=0.01)  # b: it was shut
    moved = picture_points(after.frames) - picture_points(before.frames)
    np.testing.assert_allclose(moved[12, LOWER, 1], -4.0, atol=0.02)  # the jaw rises with the lip
    assert np.abs(moved[20:28]).max() == 0  # the vowel stays as it was


def test_without_knowing_how_far_they_shut_a_motion_stays(corpus):
    motion = spoken([7.0, 7.0])
    assert closed_at_phones(motion, PHONES, speaker_like(mouth([3.0, 9.0]), np.zeros(0))) is motion


def speaker_like(shapes, shut):
    count = len(shapes)
    linear, shift, blank = np.tile(np.eye(2), (count, 1, 1)), np.zeros((count, 2)), np.zeros((count, 4, 4, 3), np.uint8)
    starts = np.arange(count) == 0
    lips, jaw = inner_outline(LAYOUT), np.asarray(LAYOUT.group("jaw"))
    return Speaker(blank, np.zeros(2, int), shapes, linear, shift, starts, blank, linear, shift, FPS, lips, jaw, shut)
