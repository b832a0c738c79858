"""What a user left to be chosen: the lead of the sound and the numbers of states, by the error on clips left out."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import numpy as np

from facesynth.methods.lds.deterministic import fit_inputs, observability, shift_invariance, stabilised
from facesynth.methods.lds.identification import fitting_rows
from facesynth.methods.lds.stochastic import noise_rows, predictor_space, realise
from facesynth.methods.lds.system import Array, Clip, Deterministic
from facesynth.methods.learn.spreading import in_pieces

FOLDS = 4
MOST_FRAMES = 6_000
"""Of longer recordings, evenly spaced clips with about this many frames decide."""


@dataclass(frozen=True)
class Choice:
    """Candidates, their held-out errors, and the one chosen."""

    candidates: tuple[float, ...]
    errors: tuple[float, ...]
    """Mean squared held-out error of each candidate, in the shape's unit squared, summed over components."""
    chosen: float


@dataclass(frozen=True, eq=False)
class Fold:
    """Clips to learn from and clips to judge by."""

    train: tuple[Clip, ...]
    test: tuple[Clip, ...]


@dataclass(frozen=True, eq=False)
class Trial:
    """Numbers of states that are tried on one fold."""

    fold: Fold
    rows: int
    orders: tuple[int, ...]


def folds(clips: Sequence[Clip], sentences: Sequence[str], rows: int) -> list[Fold]:
    """Up to four folds by sentence; a recording with fewer sentences than two is cut in time."""
    clips, sentences = _thinned(clips, sentences)
    if len(set(sentences)) < 2:
        clips = [piece for clip in clips for piece in _cut(clip, max(len(clip.u) // (2 * FOLDS), 4 * rows))]
        sentences = [str(i) for i in range(len(clips))]
    number = {sentence: i % FOLDS for i, sentence in enumerate(sorted(set(sentences)))}
    which = np.array([number[sentence] for sentence in sentences])
    return [
        Fold(
            tuple(clip for clip, w in zip(clips, which, strict=True) if w != fold),
            tuple(clip for clip, w in zip(clips, which, strict=True) if w == fold),
        )
        for fold in range(which.max() + 1)
    ]


def deterministic_errors(parts: Sequence[Fold], rows: int, orders: Sequence[int], weights: Array) -> Array:
    """[orders, held-out clips] mean squared error of the simulated output, from state zero.

    `weights` [p] are the squared scales of the shape's components.
    """
    trials = [Trial(fold, rows, tuple(orders)) for fold in parts]
    return np.concatenate(list(in_pieces(partial(_deterministic_errors, weights), trials, "numbers of states")), axis=1)


def _deterministic_errors(weights: Array, trial: Trial) -> Array:
    """[orders, held-out clips]"""
    fold = trial.fold
    gamma, _ = observability(fold.train, trial.rows)
    models = [_deterministic(fold.train, gamma, order) for order in trial.orders]
    return np.array([[_mean_square(c.y - model.simulate(c.u), weights) for c in fold.test] for model in models])


def stochastic_errors(parts: Sequence[Fold], rows: int, order: int, orders: Sequence[int], weights: Array) -> Array:
    """[orders, held-out clips] mean squared error one step ahead, beside a deterministic part of `order` states.

    The first `rows` frames of a clip do not count, while the predictor does not know the clip yet.
    """
    trials = [Trial(fold, rows, tuple(orders)) for fold in parts]
    return np.concatenate(list(in_pieces(partial(_stochastic_errors, order, weights), trials, "states of the noise")), axis=1)


def _stochastic_errors(order: int, weights: Array, trial: Trial) -> Array:
    """[orders, held-out clips]"""
    fold, rows = trial.fold, trial.rows
    gamma, _ = observability(fold.train, rows)
    model = _deterministic(fold.train, gamma, order)
    past = noise_rows(sum(len(clip.y) for clip in fold.train), rows, fold.train[0].y.shape[1])
    rest = [clip.y - model.simulate(clip.u) for clip in fold.train]
    functionals, _ = predictor_space(rest, past)
    noises = [realise(rest, past, functionals, candidate)[0] for candidate in trial.orders]
    left = [(clip.y - model.simulate(clip.u))[:, :, None] for clip in fold.test]
    return np.array([[_mean_square(noise.innovations(y)[0][rows:, :, 0], weights) for y in left] for noise in noises])


def no_change_error(parts: Sequence[Fold], rows: int, weights: Array) -> float:
    """What `stochastic_errors` would be of predicting each frame by the one before it."""
    clips = [clip for fold in parts for clip in fold.test]
    return float(np.mean([_mean_square(np.diff(clip.y, axis=0)[rows - 1 :], weights) for clip in clips]))


def plainest_good(candidates: Sequence[float], errors: Array) -> Choice:
    """The first candidate, plainest first, within one standard error of the best.

    The standard error is that of the difference to the best over held-out clips [candidates, clips]: how hard a clip
    is for all candidates says nothing about which is better.
    """
    means = errors.mean(axis=1)
    excess = errors - errors[means.argmin()]
    spread = excess.std(axis=1, ddof=1) / np.sqrt(errors.shape[1]) if errors.shape[1] > 1 else np.zeros(len(means))
    first = int(np.argmax(excess.mean(axis=1) <= spread))
    return Choice(tuple(candidates), tuple(means.tolist()), candidates[first])


def _deterministic(clips: Sequence[Clip], gamma: Array, order: int) -> Deterministic:
    A, C = shift_invariance(gamma, clips[0].y.shape[1], order)
    return fit_inputs(stabilised(A)[0], C, clips, None)[0]


def _mean_square(error: Array, weights: Array) -> float:
    return float((error**2 @ weights).mean())


def _thinned(clips: Sequence[Clip], sentences: Sequence[str]) -> tuple[Sequence[Clip], Sequence[str]]:
    step = max(1, round(sum(len(clip.u) for clip in clips) / MOST_FRAMES))
    return (clips, sentences) if len(clips) < 2 * step * FOLDS else (clips[::step], sentences[::step])


def _cut(clip: Clip, length: int) -> list[Clip]:
    count = max(len(clip.u) // length, 1)
    return [Clip(u, y) for u, y in zip(np.array_split(clip.u, count), np.array_split(clip.y, count), strict=True)]


Auto = Literal["auto"]
LEADS_MS = (0.0, 40.0, -40.0, 80.0, 120.0, 160.0)
"""Plainest first."""
LEAD_ORDER = 4
"""Deterministic states while the lead is being chosen."""
ORDERS = (1, 2, 3, 4, 6, 8, 12, 16, 24)


def choose_lead(
    wanted: float | Auto, clips_at: Callable[[float], list[Clip]], sentences: Sequence[str], rows: int, weights: Array
) -> Choice:
    """`wanted` ms, or the lead, nearest to none, whose system predicts clips left out as well as any; from `clips_at` a lead."""
    if wanted != "auto":
        return Choice((), (), float(wanted))

    by_lead = [_trials_at(clips_at(lead_ms), sentences, rows) for lead_ms in LEADS_MS]
    trials = [trial for some in by_lead for trial in some]
    errors = in_pieces(partial(_deterministic_errors, weights), trials, "lead of the sound")
    return plainest_good(LEADS_MS, np.concatenate([np.concatenate([next(errors) for _ in some], axis=1) for some in by_lead]))


def _trials_at(clips: list[Clip], sentences: Sequence[str], rows: int) -> list[Trial]:
    """Of one lead, with a few states."""
    k = fitting_rows(clips, rows)
    order = min(LEAD_ORDER, *possible_orders(clips, k)[-1:])
    return [Trial(fold, k, (order,)) for fold in folds(clips, sentences, k)]


def choose_orders(
    wanted: tuple[int | Auto, int | Auto], clips: list[Clip], sentences: Sequence[str], rows: int, weights: Array
) -> tuple[Choice, Choice, float]:
    """The numbers of deterministic and of stochastic states, and the error of predicting no change on the same clips."""
    parts = folds(clips, sentences, rows)
    orders, noises = possible_orders(clips, rows), possible_noises(parts, rows)
    deterministic = _given(wanted[0]) or plainest_good(orders, deterministic_errors(parts, rows, orders, weights))
    chosen = int(deterministic.chosen)
    stochastic = _given(wanted[1]) or plainest_good(noises, stochastic_errors(parts, rows, chosen, noises, weights))
    return deterministic, stochastic, no_change_error(parts, rows, weights)


def possible_orders(clips: Sequence[Clip], rows: int) -> list[int]:
    """Candidates that the Hankel matrices can show with rows to spare."""
    width = min(clips[0].u.shape[1], clips[0].y.shape[1])
    return [order for order in ORDERS if order <= max(1, (rows - 1) * width // 2)]


def possible_noises(parts: Sequence[Fold], rows: int) -> list[int]:
    """Candidates for the stochastic part that the shortest training side can show with as many to spare."""
    outputs = parts[0].train[0].y.shape[1]
    least = min(noise_rows(sum(len(clip.y) for clip in part.train), rows, outputs) for part in parts)
    return [order for order in ORDERS if order <= max(1, least * outputs // 2)]


def plain(choice: Choice) -> dict[str, Any]:
    """For JSON."""
    return {"candidates": list(choice.candidates), "errors": list(choice.errors), "chosen": choice.chosen}


def _given(wanted: int | Auto) -> Choice | None:
    return None if wanted == "auto" else Choice((), (), wanted)
