import numpy as np
import pytest
import torch
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis

from facesynth.inference.errors import FacesynthError
from facesynth.methods.emotion.discriminant import SHRINKAGES, fit_discriminant


def samples(classes, each, features, seed=0):
    rng = np.random.default_rng(seed)
    y = np.repeat(np.arange(classes), each)
    mixing = rng.normal(size=(features, features))
    return rng.normal(size=(classes, features))[y] + rng.normal(size=(len(y), features)) @ mixing / 3, y


@pytest.mark.parametrize(("classes", "each", "features"), [(2, 20, 5), (4, 30, 8), (5, 6, 200)])
@pytest.mark.parametrize("shrinkage", [0.05, 0.5, 0.95])
def test_decides_as_scikit_learn_does(classes, each, features, shrinkage):
    x, y = samples(classes, each, features)
    machine = fit_discriminant(x, y, shrinkage)
    equal = np.full(classes, 1 / classes)
    reference = LinearDiscriminantAnalysis(solver="lsqr", shrinkage=shrinkage, priors=equal).fit(x, y)
    new = 2 * np.random.default_rng(9).normal(size=(300, features))
    np.testing.assert_array_equal(machine.decide(torch.from_numpy(new)), reference.predict(new))


def test_many_features_without_meaning_ask_for_more_shrinkage_than_few_that_covary():
    rng = np.random.default_rng(1)
    y = np.tile(np.arange(3), 40)
    noise = rng.normal(size=(3, 300))[y] / 7 + rng.normal(size=(120, 300))
    hidden = 0.1 * np.eye(3)[y] + rng.normal(size=(120, 1)) + 0.03 * rng.normal(size=(120, 3))
    groups = np.repeat(np.arange(6), 20)

    def chosen(x):
        auto = fit_discriminant(x, y, groups=groups).weights
        return next(s for s in SHRINKAGES if torch.allclose(fit_discriminant(x, y, s).weights, auto))

    assert chosen(hidden) == SHRINKAGES[0] < chosen(noise)


def test_one_sample_of_each_class_makes_the_nearest_win():
    x = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]])
    machine = fit_discriminant(x, np.arange(3))
    near = torch.tensor([[0.5, 0.3], [3.1, 0.2], [0.1, 2.6]])
    assert machine.decide(near).tolist() == [0, 1, 2]


@pytest.mark.parametrize("shrinkage", [0.0, -1.0, 1.5])
def test_a_share_that_is_none_is_refused(shrinkage):
    x, y = samples(2, 5, 3)
    with pytest.raises(FacesynthError, match="wanted a share above 0"):
        fit_discriminant(x, y, shrinkage)
