"""Eyes: what recordings show is found back, what is grown stays what eyes can do, and what teaches nothing is refused."""

import numpy as np
import pytest
from corpora import tiny_corpus, tiny_layout, tiny_utterances
from living_eyes import FPS, learnt, recording, with_eyes

from facesynth.inference.errors import FacesynthError
from facesynth.inference.eyes import at_rest
from facesynth.inference.gaze import REACH_RAD, facing
from facesynth.inference.motion import Motion
from facesynth.inference.shift_patches import EITHER
from facesynth.methods.eyes.method import Eyes
from facesynth.methods.eyes.patch_size import knee, patch_size
from facesynth.methods.eyes.recordings import compensation_in, sharpened
from facesynth.methods.registry import load
from facesynth.motion.lids import shut_level


@pytest.fixture(scope="module")
def model():
    return learnt(recording(seed=1), recording(seed=2))


@pytest.mark.parametrize("gain", [0.0, 0.4, 0.9])
def test_what_the_eyes_undo_of_the_head_is_found(gain):
    assert compensation_in([recording(200, gain)]) == pytest.approx(gain, abs=0.05)


def test_no_head_or_one_that_stands_still_is_undone_by_nothing():
    one = recording()
    assert compensation_in([Motion(one.frames, FPS, one.layout, None, one.eyes)]) == 0
    assert compensation_in([Motion(one.frames, FPS, one.layout, np.zeros((len(one), 6)), one.eyes)]) == 0


def test_lids_that_are_seen_half_open_when_shut_shut_in_what_is_made():
    assert shut_level([recording(shut=0.45)]) == pytest.approx(0.45)
    made = learnt(recording(shut=0.45)).look(at_rest(tiny_layout(), 1200, FPS))
    assert made.eyes[:, 0].min() < 0.01
    assert made.eyes[:, 0].max() > 0.99


def test_an_averaged_jump_is_a_jump_again_and_rests_stay():
    jump = np.repeat([[0.0, 0.0], [0.2, -0.1]], 40, axis=0)
    averaged = np.stack([np.convolve(np.pad(c, 3, mode="edge"), np.ones(7) / 7, mode="valid") for c in jump.T], axis=1)
    assert (np.abs(np.diff(averaged[:, 0])) > 1e-9).sum() == 7
    again = sharpened(averaged, 7)
    assert (np.abs(np.diff(again[:, 0])) > 0.02).sum() <= 2
    assert again[:34] == pytest.approx(jump[:34])
    assert again[46:] == pytest.approx(jump[46:])
    assert np.array_equal(sharpened(averaged, 0), averaged)


def test_the_patch_is_where_the_curve_of_intervals_bends():
    intervals = np.sort(np.concatenate([np.arange(1, 21), np.arange(100, 1000, 100)]))
    assert knee(intervals) == 20
    found = patch_size([np.column_stack([one.eyes[:, 0], np.zeros((len(one), 2))]) for one in [recording()]], FPS)
    assert set(found.intervals) == {120}
    assert found.frames == 120
    assert (found.covered(119), found.covered(120)) == (0.0, 1.0)


def test_the_same_seed_gives_the_same_eyes_at_any_rate(model):
    thirty, sixty = (model.look(at_rest(tiny_layout(), round(20 * fps), fps), seed=5) for fps in (30.0, 60.0))
    assert thirty.eyes == pytest.approx(sixty.eyes[::2], abs=1e-6)
    assert np.array_equal(sixty.eyes, model.look(at_rest(tiny_layout(), 1200, 60.0), seed=5).eyes)
    assert not np.array_equal(sixty.eyes, model.look(at_rest(tiny_layout(), 1200, 60.0), seed=6).eyes)


def test_eyes_hold_their_place_while_the_head_moves(model):
    """With what the head does taken out, the gaze is that for a head which is still."""
    still = at_rest(tiny_layout(), 1200, FPS)
    head = recording(20.0).head
    moved = Motion(still.frames, FPS, still.layout, head)
    share = model.facts["compensation"][EITHER]
    assert share == pytest.approx(0.7, abs=0.1)
    with_head, without = model.look(moved).eyes, model.look(still).eyes
    undone = with_head[:, 1:] - without[:, 1:]
    assert undone[300:900] == pytest.approx(-share * np.column_stack([head[:, 1], -head[:, 0]])[300:900], abs=0.01)


def test_wide_shifts_turn_the_head_and_narrow_ones_do_not():
    wide = recording()
    eyes = wide.eyes * (1, 4, 1)
    far = learnt(Motion(wide.frames, FPS, wide.layout, None, eyes))
    made = far.look(at_rest(tiny_layout(), 1800, FPS))
    assert np.degrees(np.abs(made.head[:, 1])).max() > 5
    assert not made.head[:, 3:].any()
    near = learnt(Motion(wide.frames, FPS, wide.layout, None, wide.eyes * (1, 0.2, 0.2)), patch_s=0.5)
    assert not near.look(at_rest(tiny_layout(), 1800, FPS)).head.any()


def test_where_somebody_looks_is_the_same_whether_the_head_may_follow_or_not():
    wide = recording()
    far = learnt(Motion(wide.frames, FPS, wide.layout, None, wide.eyes * (1, 2, 2)))
    still = at_rest(tiny_layout(), 1800, FPS)
    followed, held = far.look(still), far.look(still, turning=0.0)
    assert held.head is None
    assert np.degrees(np.abs(followed.head[:, 1])).max() > 2
    assert far.look(still, turning=2.0).head == pytest.approx(2 * followed.head, abs=1e-6)
    within = np.hypot(*(held.eyes[:, 1:] / REACH_RAD).T) < 0.99
    within &= np.hypot(*(followed.eyes[:, 1:] / REACH_RAD).T) < 0.99
    assert within.mean() > 0.5
    assert (followed.eyes[:, 1:] + facing(followed.head))[within] == pytest.approx(held.eyes[:, 1:][within], abs=1e-5)


def test_eyes_stay_what_eyes_can_be():
    wide = recording()
    made = learnt(Motion(wide.frames, FPS, wide.layout, None, wide.eyes * (1, 9, 9))).look(at_rest(tiny_layout(), 3000, FPS))
    assert 0 <= made.eyes[:, 0].min() <= made.eyes[:, 0].max() <= 1
    assert np.hypot(*(made.eyes[:, 1:] / REACH_RAD).T).max() <= 1 + 1e-5


def test_it_is_trained_saved_and_loaded_as_a_method(tmp_path):
    corpus = with_eyes(tiny_corpus(tmp_path / "corpus", utterances=12, fps=60))
    fitted = Eyes().fit(corpus, seed=3)
    fitted.save(tmp_path / "eyes.safetensors")
    again = load(tmp_path / "eyes.safetensors")
    speech = tiny_utterances(1, 60, seed=3)[0][1]
    made = again.synthesize(speech, seed=2)
    assert np.array_equal(made.eyes, fitted.synthesize(speech, seed=2).eyes)
    assert len(made) == speech.phones.frame_bounds(60)[-1]
    assert made.frames == pytest.approx(np.tile(corpus.layout.neutral, (len(made), 1)), abs=1e-4)
    account = again.account(speech, seed=2)
    assert account.facts["patches"] >= 1
    assert account.facts["stuck"] >= 0


def test_lids_may_come_from_another_corpus(tmp_path):
    open_eyed = with_eyes(tiny_corpus(tmp_path / "gaze", utterances=12, fps=60), opening=1.0)
    lending = with_eyes(tiny_corpus(tmp_path / "lids", utterances=12, fps=30))
    fitted = Eyes().fit(open_eyed, lids=lending)
    assert fitted.frames[:, 0].min() < 0.1
    assert np.allclose(fitted.frames[:, 1:], Eyes().fit(open_eyed).frames[:, 1:])
    assert fitted.provenance["lids"]["performer"] == "Tiny"


def test_what_teaches_nothing_is_refused_in_a_line(tmp_path):
    corpus = tiny_corpus(tmp_path / "none", utterances=2, fps=60)
    with pytest.raises(FacesynthError, match="3.2 s of eyes"):
        Eyes().fit(corpus)
    with pytest.raises(FacesynthError, match="no recording with eyes"):
        learnt()
    one = recording()
    short, frozen = recording(3.0), Motion(one.frames, FPS, one.layout, one.head, np.tile([1.0, 0.1, 0.0], (len(one), 1)))
    for motion, said in ((short, "3.0 s of eyes"), (frozen, "frozen")):
        with pytest.raises(FacesynthError, match=said) as refused:
            learnt(motion)
        assert "\n" not in str(refused.value)
    drifting = np.tile([1.0, 0.0, 0.0], (len(one), 1)) + 0.01 * np.sin(np.arange(len(one)) / 900)[:, None]
    with pytest.raises(FacesynthError, match="in a row"):
        learnt(Motion(one.frames, FPS, one.layout, None, drifting))
    with pytest.raises(FacesynthError, match="patch"):
        learnt(one, joins="anywhere", patch_s=100.0)
    for wrong in ({"patch_s": "long"}, {"boundary": 1.0}, {"tolerance": -1.0}, {"compensation": True}):
        with pytest.raises(FacesynthError, match=next(iter(wrong))):
            Eyes(**wrong)
