"""Systems of the model's own form, with everything known, and how far an identified one is from them."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from facesynth.methods.lds.identification import frequencies
from facesynth.methods.lds.system import Clip, Deterministic, Stochastic

POLES = (0.9, 0.6)
NOISE_POLES = (0.85, 0.4)
ZEROS = (0.3, -0.2)


@dataclass(frozen=True)
class Truth:
    deterministic: Deterministic
    stochastic: Stochastic
    mixing: np.ndarray


def random_truth(seed, outputs=3, inputs=2):
    """2 + 2 states: two real deterministic poles, a complex pair and stable zeros for the noise."""
    rng = np.random.default_rng(seed)
    A_d = np.diag(rng.uniform(0.5, 0.95, 2) * np.array([1, rng.choice([-1, 1])]))
    B_d, C_d, D_d = rng.normal(size=(2, inputs)), rng.normal(size=(outputs, 2)), rng.normal(size=(outputs, inputs))
    radius, angle = rng.uniform(0.6, 0.9), rng.uniform(0.5, 2.0)
    A_s = radius * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    mixing = rng.normal(size=(outputs, outputs)) + 1.5 * np.eye(outputs)
    while True:
        C_s, B_s = rng.normal(size=(outputs, 2)), 0.5 * rng.normal(size=(2, outputs))
        if np.abs(np.linalg.eigvals(A_s - B_s @ C_s)).max() < 0.9:
            break
    mixing = mixing * 0.3
    return Truth(Deterministic(A_d, B_d, C_d, D_d), Stochastic(A_s, B_s, C_s, mixing @ mixing.T), mixing)


def recording(truth, frames, seed):
    """AR(0.9) input, Laplacian innovations of unit variance, 200 frames of burn-in thrown away."""
    rng = np.random.default_rng(seed)
    burn = 200
    u = np.zeros((frames + burn, truth.deterministic.B.shape[1]))
    white = rng.normal(size=u.shape)
    for t in range(1, len(u)):
        u[t] = 0.9 * u[t - 1] + np.sqrt(1 - 0.81) * white[t]
    v = rng.laplace(scale=np.sqrt(0.5), size=(frames + burn, len(truth.mixing)))
    y = truth.deterministic.simulate(u) + truth.stochastic.simulate(v @ truth.mixing.T)
    return Clip(u[burn:], y[burn:])


def pole_error(got, wanted):
    distance = np.abs(np.linalg.eigvals(got)[:, None] - np.linalg.eigvals(wanted))
    return distance[linear_sum_assignment(distance)].max()


def transfer_error(got, wanted):
    """Relative error of F or G in the Frobenius norm over the unit circle."""
    z = frequencies(256)
    return np.linalg.norm(got.transfer(z) - wanted.transfer(z)) / np.linalg.norm(wanted.transfer(z))


def mixing_error(got, wanted):
    """Relative error of D after the best order and signs of its columns."""
    plus = ((got[:, :, None] - wanted[:, None]) ** 2).sum(axis=0)
    minus = ((got[:, :, None] + wanted[:, None]) ** 2).sum(axis=0)
    best = np.minimum(plus, minus)
    return np.sqrt(best[linear_sum_assignment(best)].sum() / (wanted**2).sum())
