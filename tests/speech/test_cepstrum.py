import numpy as np
import pytest
import torch

from facesynth.inference.errors import FacesynthError
from facesynth.speech.cepstrum import RealCepstrum


def test_an_echo_is_a_peak_at_its_delay():
    rng = np.random.default_rng(0)
    sound = rng.normal(size=16000)
    sound[200:] += 0.5 * sound[:-200].copy()
    cepstrum = RealCepstrum(500)(torch.from_numpy(sound))
    assert cepstrum[50:].argmax() == 150


def test_a_gain_moves_only_the_first_coefficient():
    sound = torch.from_numpy(np.random.default_rng(1).normal(size=(3, 4001)))
    difference = RealCepstrum(100)(4 * sound) - RealCepstrum(100)(sound)
    torch.testing.assert_close(difference[:, 0], torch.full((3,), float(np.log(4)), dtype=torch.float64))
    assert difference[:, 1:].abs().max() < 1e-10


def test_an_impulse_has_no_cepstrum():
    assert RealCepstrum(20)(torch.eye(1, 4096, dtype=torch.float64)).abs().max() < 1e-12


def test_short_and_silent_sounds_are_finite():
    assert RealCepstrum(500)(torch.ones(10)).shape == (500,)
    assert torch.isfinite(RealCepstrum(50)(torch.zeros(1000))).all()


def test_no_coefficients_is_an_error():
    with pytest.raises(FacesynthError, match="coefficient"):
        RealCepstrum(0)
