from fractions import Fraction

import numpy as np
import pytest
from corpora import tiny_layout, tiny_utterances

from facesynth.inference.errors import FacesynthError
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.motion.resample import resample

CURVE = Layout("curves", ("jawOpen",))
RATES = [24, 25, 29.97, 30, 48, 59.94, 60, 100, 120, 240, 24000 / 1001]


def curve(values: np.ndarray, fps: float, **beside: np.ndarray) -> Motion:
    return Motion(np.asarray(values, np.float32).reshape(-1, 1), fps, CURVE, **beside)


@pytest.mark.parametrize("new_fps", RATES)
def test_frame_count_and_slow_movement_are_kept(new_fps):
    t = np.arange(605) / 120
    motion = curve(np.sin(2 * np.pi * t), 120)
    new = resample(motion, new_fps)
    assert len(new) == round(605 / 120 * new_fps)
    inner = (new.times_s > 0.3) & (new.times_s < 4.7)
    np.testing.assert_allclose(new.frames[inner, 0], np.sin(2 * np.pi * new.times_s)[inner], atol=2e-3)


def test_up_and_down_again_is_the_identity_for_speech_like_motion():
    _, _, motion = tiny_utterances(1, fps=60)[0]
    back = resample(resample(motion, 120), 60)
    assert np.abs(back.frames - motion.frames)[6:-6].max() < 0.1
    assert np.abs(back.head - motion.head)[6:-6].max() < 0.05


def test_fast_movement_does_not_come_back_as_slow_movement():
    t = np.arange(600) / 120
    motion = curve(np.sin(2 * np.pi * 28 * t), 120)
    assert np.abs(resample(motion, 30).frames[10:-10]).max() < 0.03


@pytest.mark.parametrize("new_fps", [24000 / 1001, 30000 / 1001])
def test_ten_minutes_stay_in_sync_to_half_a_frame(new_fps):
    minutes = np.arange(600 * 120) / 120
    claps = np.arange(5, 600, 5) + 0.37
    bumps = sum(np.exp(-(((minutes - clap) / 0.05) ** 2)) for clap in claps)
    new = resample(curve(bumps, 120), new_fps)
    assert len(new) == round(600 * new_fps)
    exact_fps = Fraction(round(new_fps * 1001 / 1000), 1) * Fraction(1000, 1001)
    for clap in claps:
        start = round((clap - 2) * new_fps)
        peak = start + int(new.frames[start : start + round(4 * new_fps), 0].argmax())
        assert abs(float(peak / exact_fps) - clap) <= 0.5 / new_fps + 1e-6


def test_missing_samples_stay_missing():
    values = np.linspace(0, 1, 120)
    values[30:60] = np.nan
    up = resample(curve(values, 60), 120)
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(up.frames[:, 0])), np.arange(59, 120))
    down = resample(curve(values, 60), 30)
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(down.frames[:, 0])), np.arange(15, 30))
    assert np.isnan(resample(curve(np.full(50, np.nan), 60), 25).frames).all()


def test_weights_and_lids_stay_in_range():
    square = (np.arange(240) // 20 % 2).astype(float)
    eyes = np.column_stack([square, square - 0.5, square])
    new = resample(curve(square, 60, eyes=eyes), 144)
    assert 0 <= new.frames.min() <= new.frames.max() <= 1
    assert 0 <= new.eyes[:, 0].min() <= new.eyes[:, 0].max() <= 1
    assert new.eyes[:, 1].min() < -0.5, "gaze is an angle and free"


def test_the_head_turns_through_half_a_circle_at_constant_speed():
    head = np.zeros((61, 6))
    angle = np.linspace(0, 5.5, 61)
    head[:, 1] = np.where(angle > np.pi, angle - 2 * np.pi, angle)
    head[:, 3] = np.linspace(0, 60, 61)
    new = resample(curve(np.zeros(61), 60, head=head), 120).head
    turned = np.unwrap(new[:120, 1])
    np.testing.assert_allclose(turned, np.linspace(0, 5.5 * 119 / 120, 120), atol=1e-4)
    np.testing.assert_allclose(new[:120, 3], np.arange(120) / 2, atol=1e-3)


def test_one_frame_and_the_same_rate():
    one = Motion(np.ones((1, 42), np.float32), 30, tiny_layout(), np.ones((1, 6), np.float32), np.ones((1, 3), np.float32))
    np.testing.assert_array_equal(resample(one, 120).frames, np.ones((4, 42)))
    assert resample(one, 30) is one
    assert len(resample(one, 1)) == 1


def test_nothing_and_nonsense_are_refused():
    with pytest.raises(FacesynthError, match="fps"):
        resample(curve(np.zeros(4), 30), 0)
    with pytest.raises(FacesynthError, match="frames"):
        resample(curve(np.zeros(0), 30), 60)


def test_a_sentence_is_filtered_as_a_long_recording_is(monkeypatch):
    motion = curve(np.random.default_rng(4).normal(size=300), 120)
    without_scipy = resample(motion, 30).frames
    monkeypatch.setattr("facesynth.motion.resample.SENTENCE_FRAMES", 0)
    np.testing.assert_allclose(resample(motion, 30).frames, without_scipy, atol=1e-6)
