import numpy as np
import pytest
import torch

from facesynth.inference.errors import FacesynthError
from facesynth.inference.speech import EmotionTrack, PhoneTrack, Speech
from facesynth.speech.periodogram import COEFFICIENTS, RATE, Periodogram

RATES = (25.0, 30000 / 1001, 30.0, 60.0, 120.0)


@pytest.mark.parametrize("fps", RATES)
def test_clocks_agree_after_ten_minutes(fps):
    frames = int(600 * fps)
    centres = Periodogram(fps).centres(frames)
    wanted_s = (np.arange(frames) + 0.5) / fps
    assert np.abs(centres.numpy() / RATE - wanted_s).max() <= 0.5 / RATE + 1e-9


@pytest.mark.parametrize("fps", RATES)
def test_a_click_in_the_tenth_minute_is_seen_in_its_frame(fps):
    frames = int(600 * fps)
    audio = torch.zeros(600 * RATE)
    clicked = [1, frames // 2, frames - 2]
    for frame in clicked:
        audio[round((frame + 0.5) / fps * RATE)] = 1.0
    energy = Periodogram(fps, scale="linear")(audio, frames).sum(dim=1)
    for frame in clicked:
        near = energy[frame - 1 : frame + 2]
        assert int(near.argmax()) == 1
        assert near[1] > 0


@pytest.mark.parametrize("fps", RATES)
@pytest.mark.parametrize("hz", [250.0, 1000.0, 5000.0])
def test_a_tone_peaks_at_its_frequency(fps, hz):
    audio = torch.sin(2 * torch.pi * hz * torch.arange(RATE) / RATE)
    power = Periodogram(fps, scale="linear")(audio, int(fps) - 4)[3:]
    assert power.shape[1] == COEFFICIENTS
    peak_hz = (power.argmax(dim=1) + 1) * RATE / 512
    assert (peak_hz - hz).abs().max() <= RATE / 512


def test_white_noise_has_the_power_of_the_noise():
    audio = 0.1 * torch.randn(60 * RATE, generator=torch.Generator().manual_seed(0))
    for fps in RATES:
        power = Periodogram(fps, scale="linear")(audio, int(59 * fps))
        assert power.mean().item() == pytest.approx(0.01, rel=0.02)


def test_lead_looks_ahead_by_that_time():
    audio = torch.randn(2 * RATE, generator=torch.Generator().manual_seed(0))
    plain, ahead = Periodogram(25.0)(audio, 40), Periodogram(25.0, lead_ms=120.0)(audio, 40)
    torch.testing.assert_close(ahead[:37], plain[3:])


def test_silence_is_finite_and_constant():
    power = Periodogram(30.0)(torch.zeros(RATE), 30)
    assert torch.isfinite(power).all()
    assert (power == power[0, 0]).all()


def test_frames_beyond_the_sound_are_silent():
    audio = torch.ones(RATE // 2)
    power = Periodogram(25.0, scale="linear")(audio, 25)
    assert (power[14:] == 0).all()


def test_other_sampling_rates_agree():
    at_44 = _tone(44_100)
    at_16 = _tone(16_000)
    periodogram = Periodogram(25.0)
    a, b = periodogram.of(at_44, 25), periodogram.of(at_16, 25)
    peak = b.argmax(dim=1)[3:-3]
    torch.testing.assert_close(a.argmax(dim=1)[3:-3], peak)
    torch.testing.assert_close(a.max(dim=1).values[3:-3], b.max(dim=1).values[3:-3], atol=0.01, rtol=0)


def test_bad_settings_say_what_is_wanted():
    with pytest.raises(FacesynthError, match="log"):
        Periodogram(25.0, scale="logarithmic")
    with pytest.raises(FacesynthError, match="fps"):
        Periodogram(0.0)


def _tone(rate):
    audio = np.sin(2 * np.pi * 440 * np.arange(rate) / rate).astype(np.float32)
    return Speech(audio, rate, PhoneTrack(("pau",), np.array([1.0])), EmotionTrack.constant("neutral", 1.0))
