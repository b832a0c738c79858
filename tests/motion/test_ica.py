import numpy as np
import pytest
import torch

from facesynth.inference.errors import FacesynthError
from facesynth.motion.ica import Ica

MIXING = np.array([[3.0, 0.5, 0.1], [1.0, -2.0, 0.2], [0.3, 0.4, 1.0]])


@pytest.fixture(scope="module")
def sources():
    rng = np.random.default_rng(0)
    t = np.arange(4000) / 120
    columns = [np.sign(np.sin(7 * t)), np.sin(3 * t) ** 3, rng.laplace(size=len(t))]
    return np.stack([(c - c.mean()) / c.std() for c in columns], axis=1)


def test_finds_the_sources_that_were_mixed(sources):
    ica = Ica.fit(sources @ MIXING.T + 5, seed=1)
    found = ica.encode(torch.from_numpy(sources @ MIXING.T + 5).float()).numpy()
    correlation = np.abs(np.corrcoef(found.T, sources.T)[:3, 3:])
    assert sorted(correlation.argmax(axis=1)) == [0, 1, 2]
    assert correlation.max(axis=1).min() > 0.98


def test_order_and_sign_do_not_depend_on_the_seed(sources):
    a, b = (Ica.fit(sources @ MIXING.T, seed=s).mixing.numpy() for s in (0, 17))
    np.testing.assert_allclose(a, b, atol=0.03)
    energy = np.square(a).sum(axis=0)
    assert (np.diff(energy) <= 0).all()
    assert (a[np.abs(a).argmax(axis=0), range(3)] > 0).all()


def test_decode_undoes_encode(sources):
    ica = Ica.fit(sources @ MIXING.T)
    x = torch.randn(5, 7, 3, generator=torch.Generator().manual_seed(0))
    torch.testing.assert_close(ica.decode(ica(x)), x, atol=1e-5, rtol=1e-5)


def test_one_channel_is_only_scaled():
    ica = Ica.fit(np.arange(10.0)[:, None])
    assert ica(torch.arange(10.0)[:, None]).std(correction=0) == pytest.approx(1, rel=1e-5)


def test_what_cannot_be_separated_is_refused(sources):
    with pytest.raises(FacesynthError, match="converge"):
        Ica.fit(np.random.default_rng(0).normal(size=(600, 20)), iterations=1)
    with pytest.raises(FacesynthError, match="more frames"):
        Ica.fit(sources[:3])
    with pytest.raises(FacesynthError, match="never move"):
        Ica.fit(np.concatenate([sources, np.ones((4000, 1))], axis=1))
