import numpy as np
import pytest

from facesynth.evaluation.residual_tests import ljung_box, mutual_information, pairwise_information
from facesynth.inference.errors import FacesynthError


def autoregression(share, count, seed):
    e = np.random.default_rng(seed).normal(size=count)
    x = np.zeros(count)
    for t in range(1, count):
        x[t] = share * x[t - 1] + e[t]
    return x


def test_ljung_box_of_a_known_signal():
    x = np.array([1.0, -1.0] * 10)  # r_1 = -19/20, r_2 = 18/20
    q, _ = ljung_box([x], lags=2)
    assert q == pytest.approx(20 * 22 * (0.95**2 / 19 + 0.9**2 / 18))


def test_white_noise_is_refused_as_often_as_chance_says():
    rng = np.random.default_rng(0)
    chances = np.array([ljung_box([rng.normal(size=300), rng.normal(size=300)])[1] for _ in range(400)])
    assert 0.02 < (chances < 0.05).mean() < 0.09
    assert np.median(chances) == pytest.approx(0.5, abs=0.1)


def test_an_autoregression_is_not_white():
    assert ljung_box([autoregression(0.3, 400, 0)])[1] < 1e-3


def test_clips_do_not_go_on_in_one_another():
    """Each clip ends where the next begins; across their ends nothing is correlated."""
    clips = [np.array([1.0, 1, -1, -1]) * sign for sign in (1, -1)] * 5
    apart, _ = ljung_box(clips, lags=1)
    whole, _ = ljung_box([np.concatenate(clips)], lags=1)
    assert apart != pytest.approx(whole)
    assert apart == pytest.approx(40 * 42 * (1 / 4) ** 2 / 30)


@pytest.mark.parametrize("correlation", [0.0, 0.5, 0.9])
def test_mutual_information_of_gaussians(correlation):
    x, other = np.random.default_rng(0).normal(size=(2, 40_000))
    y = correlation * x + np.sqrt(1 - correlation**2) * other
    found, chance = mutual_information(x, y, classes=16)
    assert found == pytest.approx(-np.log(1 - correlation**2) / 2, rel=0.12, abs=2e-3)
    assert (chance < 0.01) == (correlation > 0)


def test_dependence_without_correlation_is_seen():
    x = np.random.default_rng(0).normal(size=4000)
    assert mutual_information(x, np.square(x))[1] < 1e-9


def test_independent_sources_pass_and_mixed_ones_do_not():
    sources = np.random.default_rng(0).laplace(size=(6000, 4))
    mixed = sources @ np.random.default_rng(1).normal(size=(4, 4))
    assert pairwise_information(sources)[1] > 0.6
    assert pairwise_information(mixed)[1] < 0.2
    assert pairwise_information(mixed)[0] > 10 * pairwise_information(sources)[0]


def test_too_little_is_refused():
    with pytest.raises(FacesynthError, match="10 lags need clips of more samples"):
        ljung_box([np.zeros(5)])
    with pytest.raises(FacesynthError, match="constant"):
        ljung_box([np.ones(50)])
    with pytest.raises(FacesynthError, match="320 samples or more"):
        mutual_information(np.zeros(10), np.zeros(10))
