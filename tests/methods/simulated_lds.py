"""Systems of the model's own form, with everything known, and how far an identified one is from them."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from facesynth.methods.lds.identification import frequencies, identify
from facesynth.methods.lds.innovations import Innovations, innovations_of
from facesynth.methods.lds.system import Clip, Deterministic, Stochastic


@dataclass(frozen=True)
class Truth:
    deterministic: Deterministic
    stochastic: Stochastic
    mixing: np.ndarray


def random_truth(seed, outputs=3, inputs=2):
    """2 + 2 states: a pair of poles of modulus 0.8 to 0.95, one of 0.6 to 0.9 for the noise, zeros within 0.9."""
    rng = np.random.default_rng(seed)
    A_d, A_s = _pole_pair(rng, 0.8, 0.95), _pole_pair(rng, 0.6, 0.9)
    B_d, C_d, D_d = rng.normal(size=(2, inputs)), rng.normal(size=(outputs, 2)), rng.normal(size=(outputs, inputs))
    mixing = 0.3 * _until(lambda: rng.normal(size=(outputs, outputs)), lambda m: np.linalg.cond(m) < 10)
    C_s, B_s = _until(
        lambda: (rng.normal(size=(outputs, 2)), 0.5 * rng.normal(size=(2, outputs))),
        lambda drawn: np.abs(np.linalg.eigvals(A_s - drawn[1] @ drawn[0])).max() < 0.9,
    )
    return Truth(Deterministic(A_d, B_d, C_d, D_d), Stochastic(A_s, B_s, C_s, mixing @ mixing.T), mixing)


def recording(truth, frames, seed):
    """AR(0.9) input of unit variance, Laplacian innovations of unit variance; 200 frames of burn-in are thrown away."""
    rng = np.random.default_rng(seed)
    burn = 200
    u = np.zeros((frames + burn, truth.deterministic.B.shape[1]))
    white = rng.normal(scale=np.sqrt(1 - 0.9**2), size=u.shape)
    for t in range(1, len(u)):
        u[t] = 0.9 * u[t - 1] + white[t]
    v = rng.laplace(scale=np.sqrt(0.5), size=(frames + burn, len(truth.mixing)))
    y = truth.deterministic.simulate(u) + truth.stochastic.simulate(v @ truth.mixing.T)
    return Clip(u[burn:], y[burn:])


def errors(truth, clips, rows):
    """Deterministic poles, F, stochastic poles, G, D, and 3 minus the mean excess kurtosis of v."""
    system = identify(clips, rows, (2, 2))
    e = innovations_of(system.stochastic_output(clips), system.stochastic, 50)
    found = Innovations.fit(e)
    return np.array(
        [
            pole_error(system.deterministic.A, truth.deterministic.A),
            transfer_error(system.deterministic, truth.deterministic),
            pole_error(system.stochastic.A, truth.stochastic.A),
            transfer_error(system.stochastic, truth.stochastic),
            mixing_error(found.mixing.numpy(), truth.mixing),
            3 - found.kurtosis.mean().item(),
        ]
    )


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


def _pole_pair(rng, low, high):
    radius, angle = rng.uniform(low, high), rng.uniform(0.3, 1.5)
    return radius * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def _until(draw, good):
    while not good(drawn := draw()):
        pass
    return drawn
