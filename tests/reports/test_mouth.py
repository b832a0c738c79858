"""Mouths that move too little or too much: a gain that keeps closures; and mouthClose, which never goes above jawOpen."""

import numpy as np
import pytest
from bringing import FPS, lay_down, run, spoken
from corpora import tiny_corpus
from grids import long_grid, put
from heads import head

from facesynth.face.rig.markers import LipGap
from facesynth.face.solve.animate import CLOSE, JAW, MOUTH, amplified, close_within_jaw
from facesynth.motion.arkit_names import ARKIT_NAMES

PAPA = [("P", 0.0, 0.2), ("AA1", 0.2, 0.4), ("P", 0.4, 0.6), ("AA1", 0.6, 0.8), ("M", 0.8, 1.0), ("AA1", 1.0, 1.2)]
PAPA += [("M", 1.2, 1.4), ("AA1", 1.4, 1.6)]
CLOSED = [frame for label, start, _ in PAPA if label in "PM" for frame in [round((start + 0.1) * FPS)]]


@pytest.fixture
def papa(tmp_path):
    sound = lay_down(tmp_path / "session", "papa", 1.6)
    put(sound.with_suffix(".TextGrid"), long_grid([("phones", PAPA)], 0.0, 1.6))
    return sound


@pytest.mark.parametrize("gain", [0.3, 0.7, 1.5, 2.5])
def test_a_gain_moves_the_mouth_and_keeps_closures_shut(tmp_path, talker, papa, rig, gain):
    lips = LipGap.of(rig)

    def openings(*options):
        curves, _ = spoken(talker, papa, tmp_path, *options)
        weights = np.stack([curves[name] for name in ARKIT_NAMES], axis=1)
        return lips.opening_mm(weights), weights

    plain, before = openings()
    moved, after = openings("--mouth", gain)
    assert moved[CLOSED].max() < plain[CLOSED].max() + 0.3
    wide = plain.argmax()
    assert moved[wide] == pytest.approx(min(gain, 1 / 0.9) * plain[wide], rel=0.1)
    others = np.setdiff1d(np.arange(52), MOUTH)
    np.testing.assert_allclose(after[:, others], before[:, others], atol=1e-6)


def test_a_still_mouth_and_a_gain_that_is_none(tmp_path, talker, papa):
    curves, _ = spoken(talker, papa, tmp_path, "--mouth", 0)
    assert max(values.max() for name, values in curves.items() if name.startswith(("jaw", "mouth"))) < 1e-6
    for wrong, said in (("-1", "x>=0"), ("much", "not a valid float"), ("nan", "factor of 0 or above")):
        code, _, error = run("speak", talker, papa, "-o", tmp_path / "o.npz", "--mouth", wrong)
        assert (code, said in error) == (2, True), error
    code, _, error = run("speak", talker, papa, "-o", tmp_path / "o.npz", "--mouth", 2, "--deform", "regions")
    assert (code, "leave one out" in error) == (2, True)


@pytest.mark.parametrize("seed", range(3))
def test_any_weights_keep_what_was_shut(rig, seed):
    lips, rng = LipGap.of(rig), np.random.default_rng(seed)
    weights = rng.uniform(0, 0.5, (200, 52)) * (rng.random((200, 52)) < 0.2)
    weights[::2, CLOSE] = weights[::2, JAW]
    before = lips.opening_mm(weights)
    for gain in (0.5, 1.3, 3.0):
        after = amplified(weights, gain, lips)
        assert ((after >= 0) & (after <= 1)).all()
        shut = (before >= 0) & (before < 0.5)
        assert (lips.opening_mm(after)[shut] < before[shut] + 0.6).all()
    np.testing.assert_array_equal(amplified(weights, 1.0, lips), weights)


def test_close_stays_within_the_jaw_and_lips_as_near(rig):
    lips = LipGap.of(rig)
    weights = np.zeros((2, 52))
    weights[:, JAW], weights[:, CLOSE] = 0.2, 0.3
    weights[:, [ARKIT_NAMES.index(f"mouthUpperUp{side}") for side in ("Left", "Right")]] = 0.6
    after = close_within_jaw(weights, lips)
    assert (after[:, CLOSE] <= after[:, JAW]).all()
    np.testing.assert_allclose(lips.opening_mm(after), lips.opening_mm(weights), atol=1e-6)


def test_on_a_head_whose_mouth_close_corrects_jaw_open(tmp_path, papa):
    """Points of another performer who says papa mama, on a head of one's own with both shapes."""
    from facesynth.methods.baselines.phone_mean import PhoneMean

    model = tmp_path / "points.safetensors"
    PhoneMean().fit(tiny_corpus(tmp_path / "actor", utterances=6, fps=50)).save(model)
    path = head(tmp_path / "head.glb", names=("jawOpen", "mouthClose", "mouthSmileLeft", "mouthSmileRight", "Frozen"))
    for options in ((), ("--mouth", 1.8)):
        curves, _ = spoken(model, papa, tmp_path, "--rig", path, *options)
        assert curves["jawOpen"].max() > 0.1
        assert (curves["mouthClose"] <= curves["jawOpen"] + 1e-6).all()
    for options in ((), ("--rig", path, "--fps", 24, "--mouth", 0.4), ("--fps", 47)):
        curves, _ = spoken(model, papa, tmp_path, *options)
        assert (curves["mouthClose"] <= curves["jawOpen"]).all(), options


@pytest.mark.parametrize("late_s", [0.0, 0.021, 0.042, 0.063])
def test_at_12_pictures_a_second_every_closure_is_seen(tmp_path, talker, rig, late_s):
    """pa ma ba: lips that are shut for 60 ms, wherever the pictures fall."""
    said = [("P", "AA1"), ("M", "AA1"), ("B", "AA1"), ("P", "IY1")]
    grid, now_s = [], 0.2 + late_s
    for shut, wide in said:
        grid += [(shut, now_s, now_s + 0.06), (wide, now_s + 0.06, now_s + 0.26)]
        now_s += 0.26
    sound = lay_down(tmp_path / "session", "pamaba", 1.6)
    put(sound.with_suffix(".TextGrid"), long_grid([("phones", grid)], 0.0, 1.6))
    lips = LipGap.of(rig)

    def openings(fps):
        curves, _ = spoken(talker, sound, tmp_path, "--fps", fps)
        return lips.opening_mm(np.stack([curves[name] for name in ARKIT_NAMES], axis=1))

    whole, few = openings(FPS), openings(12)
    for _, start_s, end_s in grid[::2]:
        closed = whole[round(start_s * FPS) : round(end_s * FPS)].min()
        near = few[int(start_s * 12) : int(np.ceil(end_s * 12)) + 1].min()
        assert near < closed + 0.2
    assert few.max() > 0.6 * whole.max(), "between them the mouth opens"
