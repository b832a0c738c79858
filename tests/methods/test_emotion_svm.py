import numpy as np
import pytest
import torch
from sklearn.svm import SVC, NuSVC

from facesynth.inference.errors import FacesynthError
from facesynth.methods.emotion.probabilities import couple, fit_sigmoid, vote
from facesynth.methods.emotion.svm import KERNELS, SvmSettings, fit_svm


def blobs(classes, seed=0, each=25, features=6):
    rng = np.random.default_rng(seed)
    centres = rng.normal(size=(classes, features))
    y = np.repeat(np.arange(classes), each + np.arange(classes) * 3)
    return centres[y] + rng.normal(size=(len(y), features)), y


@pytest.mark.parametrize("classes", [2, 3, 5])
@pytest.mark.parametrize("kernel", ["linear", "polynomial", "radial"])
@pytest.mark.parametrize("formulation", ["C", "nu"])
def test_decides_as_scikit_learn_does(classes, kernel, formulation):
    x, y = blobs(classes)
    machine = fit_svm(x, y, SvmSettings(kernel, formulation, nu=0.3))
    shared = {"kernel": KERNELS[kernel], "gamma": "auto", "decision_function_shape": "ovo"}
    reference = (SVC(**shared) if formulation == "C" else NuSVC(nu=0.3, **shared)).fit(x, y)
    new = np.random.default_rng(9).normal(size=(300, x.shape[1])) * 1.5
    np.testing.assert_array_equal(machine.decide(torch.from_numpy(new)), reference.predict(new))
    margins = reference.decision_function(new)
    np.testing.assert_allclose(machine.margins(torch.from_numpy(new)), margins if classes > 2 else -margins[:, None], atol=1e-9)


def coupled_plainly(r):
    """The iteration of Wu, Lin and Weng 2004, algorithm 2; r[i, j] is the probability of i among i and j."""
    k = len(r)
    q = np.zeros((k, k))
    for i in range(k):
        for j in range(k):
            q[i, j] = sum(r[s, i] ** 2 for s in range(k) if s != i) if i == j else -r[j, i] * r[i, j]
    p = np.full(k, 1 / k)
    for _ in range(1000):
        for t in range(k):
            p[t] = (p @ q @ p - sum(q[t, j] * p[j] for j in range(k) if j != t)) / q[t, t]
            p = p / p.sum()
    return p


@pytest.mark.parametrize("classes", [2, 3, 4, 8])
def test_coupled_probabilities_equal_a_plain_reference(classes):
    rng = np.random.default_rng(classes)
    pairwise = rng.uniform(0.02, 0.98, (3, classes * (classes - 1) // 2))
    found = couple(torch.from_numpy(pairwise), classes).numpy()
    for row, p in zip(pairwise, found, strict=True):
        r = np.zeros((classes, classes))
        for value, (i, j) in zip(row, zip(*np.triu_indices(classes, 1), strict=True), strict=True):
            r[i, j], r[j, i] = value, 1 - value
        np.testing.assert_allclose(p, coupled_plainly(r), atol=1e-4)


def test_consistent_pairs_give_back_their_classes():
    p = np.array([0.5, 0.3, 0.15, 0.05])
    i, j = np.triu_indices(4, 1)
    np.testing.assert_allclose(couple(torch.from_numpy(p[i] / (p[i] + p[j])), 4), p, atol=1e-9)


def test_certain_pairs_stay_finite():
    p = couple(torch.tensor([1.0, 1.0, 1.0]), 3)
    assert torch.isfinite(p).all()
    assert p[0] > 0.99


def test_platt_finds_the_sigmoid_that_made_the_labels():
    rng = np.random.default_rng(0)
    margins = rng.uniform(-3, 3, 20000)
    positive = rng.random(20000) < 1 / (1 + np.exp(-1.7 * margins + 0.4))
    assert fit_sigmoid(margins, positive) == pytest.approx((-1.7, 0.4), abs=0.08)


def test_platt_minimises_its_loss_and_stays_finite_on_separable_margins():
    margins = np.array([-2.0, -1.0, 1.0, 2.0])
    positive = margins > 0
    a, b = fit_sigmoid(margins, positive)

    def loss(a, b):
        p = 1 / (1 + np.exp(a * margins + b))
        t = np.where(positive, 3 / 4, 1 / 4)
        return -np.sum(t * np.log(p) + (1 - t) * np.log(1 - p))

    assert a < 0
    assert all(loss(a, b) <= loss(a + da, b + db) for da in (-0.01, 0, 0.01) for db in (-0.01, 0, 0.01))


def test_probabilities_are_calibrated():
    x, y = blobs(3, each=400)
    train = np.arange(len(y)) % 2 == 0
    p = fit_svm(x[train], y[train], SvmSettings("radial"))(torch.from_numpy(x[~train])).numpy()
    np.testing.assert_allclose(p.sum(axis=1), 1)
    sure, right = p.max(axis=1), p.argmax(axis=1) == y[~train]
    for low, high in ((0.4, 0.6), (0.6, 0.8), (0.8, 1.0)):
        among = (sure >= low) & (sure < high)
        assert abs(right[among].mean() - sure[among].mean()) < 0.15


def test_votes_tie_to_the_lowest_class():
    assert vote(torch.tensor([[1.0, -1.0, 1.0]]), 3).tolist() == [0]
    assert vote(torch.tensor([[-1.0, -1.0, -1.0]]), 3).tolist() == [2]


def test_one_class_and_unknown_kernels_are_refused():
    x, y = blobs(2)
    with pytest.raises(FacesynthError, match="two classes"):
        fit_svm(x, np.zeros_like(y), SvmSettings())
    with pytest.raises(FacesynthError, match="kernel"):
        fit_svm(x, y, SvmSettings("cubic"))
