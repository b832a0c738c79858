import numpy as np
import pytest
import torch

from facesynth.speech.mel import LogMel, sample_at


def test_frames_are_centred_on_multiples_of_the_hop():
    mel = LogMel()
    audio = torch.zeros(16000)
    audio[8000] = 1.0
    energies = mel(audio)
    assert energies.shape == (101, 40)
    assert mel.fps == 100
    assert int(energies.sum(dim=1).argmax()) == 50


@pytest.mark.parametrize("pitch", [200.0, 1000.0, 4000.0])
def test_a_tone_lights_the_band_that_holds_it(pitch):
    mel = LogMel()
    tone = torch.sin(2 * torch.pi * pitch * torch.arange(16000) / 16000)
    centre_mel = 2595 * np.log10(1 + 8000 / 700) * (int(mel(tone)[50].argmax()) + 1) / 41
    assert 2595 * np.log10(1 + pitch / 700) == pytest.approx(centre_mel, abs=60)


def test_twice_as_loud_is_log_four_more():
    mel, noise = LogMel(), torch.from_numpy(np.random.default_rng(0).normal(0, 0.1, 8000)).float()
    assert torch.allclose(mel(2 * noise)[5:-5] - mel(noise)[5:-5], torch.tensor(np.log(4.0)).float(), atol=1e-3)


def test_triangles_of_neighbours_sum_to_one_between_the_first_and_the_last_centre():
    filters = LogMel(20, window_s=4096 / 16000).filters.numpy()
    assert filters.shape == (2049, 20)
    peaks = filters.argmax(axis=0)
    assert filters[peaks[0] : peaks[-1]].sum(axis=1) == pytest.approx(1, abs=0.02)


def test_silence_and_a_moment_of_sound_are_finite():
    mel = LogMel()
    assert torch.isfinite(mel(torch.zeros(1600))).all()
    assert mel(torch.zeros(2, 10)).shape == (2, 1, 40)


def test_sampling_is_linear_between_frames_and_holds_the_ends():
    features = torch.tensor([[0.0], [1.0], [3.0]])
    assert sample_at(features, 10.0, np.array([[-1.0, 0.05], [0.15, 9.0]]))[..., 0].tolist() == [[0.0, 0.5], [2.0, 3.0]]
