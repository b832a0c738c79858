import numpy as np
import pytest
import torch

from facesynth.inference.errors import FacesynthError
from facesynth.motion.pca import Pca


@pytest.fixture
def frames():
    rng = np.random.default_rng(0)
    return rng.normal(size=(200, 3)) @ rng.normal(size=(3, 12)) + 0.01 * rng.normal(size=(200, 12)) + 5


def test_all_components_reproduce_the_frames(frames):
    pca = Pca.fit(frames, 12)
    x = torch.from_numpy(frames).float()
    torch.testing.assert_close(pca.decode(pca.encode(x)), x, atol=1e-4, rtol=0)


def test_basis_is_orthonormal_so_distances_survive(frames):
    pca = Pca.fit(frames, 12)
    z = pca.encode(torch.from_numpy(frames).float())
    torch.testing.assert_close(pca.basis.T @ pca.basis, torch.eye(12), atol=1e-5, rtol=0)
    np.testing.assert_allclose(
        torch.cdist(z[:5], z[5:9]).numpy(), np.linalg.norm(frames[:5, None] - frames[5:9], axis=-1), rtol=1e-3
    )


def test_share_of_variance_picks_the_three_directions_that_matter(frames):
    assert Pca.fit(frames, 0.99).basis.shape == (12, 3)


def test_sign_does_not_depend_on_the_order_of_frames(frames):
    a, b = Pca.fit(frames, 3), Pca.fit(frames[::-1].copy(), 3)
    torch.testing.assert_close(a.basis, b.basis, atol=1e-5, rtol=1e-4)


def test_refuses_nan_and_too_few_frames():
    with pytest.raises(FacesynthError, match="complete frames"):
        Pca.fit(np.full((4, 3), np.nan), 2)
    with pytest.raises(FacesynthError, match="at least 2"):
        Pca.fit(np.zeros((1, 3)), 2)
    with pytest.raises(FacesynthError, match="components"):
        Pca.fit(np.eye(3), 0)
