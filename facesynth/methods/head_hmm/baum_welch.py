"""A hidden Markov model with an exit, learned by forward-backward (Rabiner 1989), many sequences at once."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.arrays import Floats
from facesynth.methods.head_hmm.codebook import codebook

SMALLEST_VARIANCE = 0.02
"""Of a Gaussian, in units of the features' variance: few frames must not make a needle."""
LEAST_WEIGHT = 1e-6
SETTLED = 1e-3
"""Log likelihood a frame; what gains less has settled."""
NEVER = -1e9
"""Logarithm of a probability of 0."""


@dataclass(frozen=True, eq=False)
class Mixtures:
    """Gaussian mixtures of S states, diagonal."""

    log_weights: Floats
    """[S, M]"""
    means: Floats
    """[S, M, D]"""
    variances: Floats
    """[S, M, D]"""

    def log_parts(self, frames: Floats) -> Floats:
        """[..., S, M] of frames [..., D]: weight times density, as a logarithm."""
        squares = np.square(frames[..., None, None, :] - self.means) / self.variances
        norm = np.log(2 * np.pi * self.variances).sum(axis=-1)
        return np.asarray(self.log_weights - 0.5 * (norm + squares.sum(axis=-1)))


@dataclass(frozen=True, eq=False)
class Hmm:
    """S states; a sequence begins in one, goes on, and leaves from one."""

    log_start: Floats
    """[S]"""
    log_step: Floats
    """[S, S] from row to column; with the exit each row sums to 1."""
    log_exit: Floats
    """[S]"""
    mixtures: Mixtures


def left_to_right(states: int, frames: float) -> tuple[Floats, Floats, Floats]:
    """Logarithms of start, step and exit of states that follow each other, each about as long, `frames` together."""
    leave = min(0.9, states / max(frames, states))
    step = (1 - leave) * np.eye(states) + leave * np.eye(states, k=1)
    start, out = np.zeros(states), np.zeros(states)
    start[0], out[-1] = 1.0, leave
    return _log(start), _log(step), _log(out)


def ergodic(states: int, frames: float) -> tuple[Floats, Floats, Floats]:
    """The same of states that all follow each other."""
    leave = 1 / max(frames, 2.0)
    even = (1 - leave) * (0.5 * np.eye(states) + 0.5 / states)
    return _log(np.full(states, 1 / states)), _log(even), _log(np.full(states, leave))


def begun(sequences: Sequence[Floats], states: int, mixtures: int, *, all_follow: bool) -> Hmm:
    """A model to start from: every sequence [T, D] cut into as many equal stretches as there are states."""
    frames = np.concatenate(sequences)
    place = np.concatenate([np.minimum(np.arange(len(s)) * states // len(s), states - 1) for s in sequences])
    shape = (ergodic if all_follow else left_to_right)(states, len(frames) / len(sequences))
    found = [_mixture(frames[place == s] if (place == s).any() else frames, mixtures) for s in range(states)]
    return Hmm(*shape, Mixtures(*(np.stack(parts) for parts in zip(*found, strict=True))))


def learn(model: Hmm, sequences: Sequence[Floats], rounds: int) -> tuple[Hmm, tuple[float, ...]]:
    """Baum-Welch from a model on; the log likelihood of all sequences before each round and at the end never falls."""
    padded, inside = _padded(sequences)
    likelihoods: list[float] = []
    for _ in range(rounds):
        better, likelihood = _round(model, padded, inside)
        likelihoods.append(likelihood)
        if len(likelihoods) > 1 and likelihood - likelihoods[-2] < SETTLED * inside.sum():
            return model, tuple(likelihoods)
        model = better
    return model, (*likelihoods, log_likelihood(model, sequences))


def log_likelihood(model: Hmm, sequences: Sequence[Floats]) -> float:
    """Of all sequences [T, D], the exit included."""
    padded, inside = _padded(sequences)
    forward = _forward(model, _together(model.mixtures.log_parts(padded), 3), inside)
    return float(_together(forward[:, -1] + model.log_exit, 1).sum())


def _round(model: Hmm, frames: Floats, inside: NDArray[np.bool_]) -> tuple[Hmm, float]:
    """Expectation and maximisation over sequences [N, T, D] that end where `inside` [N, T] does."""
    parts = model.mixtures.log_parts(frames)
    seen = _together(parts, 3)
    forward, backward = _forward(model, seen, inside), _backward(model, seen, inside)
    whole = _together(forward[:, -1] + model.log_exit, 1)
    state = np.exp(forward + backward - whole[:, None, None]) * inside[..., None]
    onward = (seen + backward)[:, 1:, None] + model.log_step + forward[:, :-1, :, None] - whole[:, None, None, None]
    steps = (np.exp(np.minimum(onward, 0)) * inside[:, 1:, None, None]).sum(axis=(0, 1))
    last = np.arange(len(frames)), inside.sum(axis=1) - 1
    leaves, begins = state[last].sum(axis=0), state[:, 0].sum(axis=0)
    total = steps.sum(axis=1) + leaves
    used = total > LEAST_WEIGHT
    step = np.where(used[:, None], _log(steps / np.maximum(total, LEAST_WEIGHT)[:, None]), model.log_step)
    out = np.where(used, _log(leaves / np.maximum(total, LEAST_WEIGHT)), model.log_exit)
    share = state[..., None] * np.exp(parts - seen[..., None])
    better = replace(
        model,
        log_start=_log(begins / begins.sum()),
        log_step=step,
        log_exit=out,
        mixtures=_moved(model.mixtures, frames, share),
    )
    return better, float(whole.sum())


def _moved(old: Mixtures, frames: Floats, share: Floats) -> Mixtures:
    """Mixtures of frames [N, T, D] that belong to parts by shares [N, T, S, M]; parts that nothing belongs to stay."""
    mass = share.sum(axis=(0, 1))
    used, safe = (mass > 1e-3)[..., None], np.maximum(mass, 1e-9)[..., None]
    means = np.where(used, np.einsum("ntsm,ntd->smd", share, frames) / safe, old.means)
    squares = np.einsum("ntsm,ntd->smd", share, np.square(frames)) / safe - np.square(means)
    variances = np.where(used, np.maximum(squares, SMALLEST_VARIANCE), old.variances)
    per_state = mass.sum(axis=1, keepdims=True)
    weights = np.where(per_state > 1e-3, mass / np.maximum(per_state, 1e-9), np.exp(old.log_weights))
    return Mixtures(_log(weights), means, variances)


def _forward(model: Hmm, seen: Floats, inside: NDArray[np.bool_]) -> Floats:
    """[N, T, S]; after the end of a sequence its last values are held."""
    found = np.empty_like(seen)
    found[:, 0] = model.log_start + seen[:, 0]
    for t in range(1, seen.shape[1]):
        onward = _together(found[:, t - 1, :, None] + model.log_step, 1) + seen[:, t]
        found[:, t] = np.where(inside[:, t, None], onward, found[:, t - 1])
    return found


def _backward(model: Hmm, seen: Floats, inside: NDArray[np.bool_]) -> Floats:
    found = np.empty_like(seen)
    found[:, -1] = model.log_exit
    for t in range(seen.shape[1] - 2, -1, -1):
        back = _together(model.log_step + (seen[:, t + 1] + found[:, t + 1])[:, None], 2)
        found[:, t] = np.where(inside[:, t + 1, None], back, model.log_exit)
    return found


def _mixture(frames: Floats, count: int) -> tuple[Floats, Floats, Floats]:
    """Logarithms of weights [M], means and variances [M, D] of a codebook's cells; one cell stands for those that lack."""
    cells = codebook(frames, count)
    numbers = np.minimum(np.arange(count), len(cells.means) - 1)
    held = np.bincount(cells.labels, minlength=len(cells.means))[numbers] / np.bincount(numbers)[numbers]
    variances = np.stack([np.maximum(frames[cells.labels == k].var(axis=0), SMALLEST_VARIANCE) for k in numbers])
    return _log(held / held.sum()), cells.means[numbers], variances


def _padded(sequences: Sequence[Floats]) -> tuple[Floats, NDArray[np.bool_]]:
    """[N, T, D] and which frames [N, T] are of a sequence."""
    lengths = np.array([len(s) for s in sequences])
    frames = np.zeros((len(sequences), lengths.max(), sequences[0].shape[1]))
    for n, sequence in enumerate(sequences):
        frames[n, : len(sequence)] = sequence
    return frames, np.arange(lengths.max()) < lengths[:, None]


def _log(shares: Floats) -> Floats:
    return np.where(shares > 0, np.log(np.maximum(shares, 1e-300)), NEVER)


def _together(logs: Floats, axis: int) -> Floats:
    """Logarithm of the sum of exponentials."""
    largest = logs.max(axis=axis, keepdims=True)
    return np.asarray(np.squeeze(largest, axis) + np.log(np.exp(logs - largest).sum(axis=axis)))
