"""From recordings to a linear system: the orthogonal decomposition, step by step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facesynth.errors import FacesynthError
from facesynth.methods.lds.deterministic import fit_inputs, observability, shift_invariance, stabilised
from facesynth.methods.lds.stochastic import predictor_space, realise
from facesynth.methods.lds.system import Array, Clip, LinearSystem

REFITS = 2
"""How often the deterministic part is fitted again with the noise model known."""


def identify(clips: Sequence[Clip], rows: int, orders: tuple[int, int]) -> LinearSystem:
    """A system with `orders` = (deterministic, stochastic) states from clips of any lengths.

    `rows` is k, the number of block rows: how many frames of past and of future are compared.
    Signals should have zero mean and comparable scale. The stochastic part is identified from what
    the deterministic part leaves of the output and not from the projection that is orthogonal
    to the inputs, because that projection still holds deterministic state that a finite window cannot see.
    """
    require_enough(clips, rows, orders)
    gamma, singular = observability(clips, rows)
    A, C = shift_invariance(gamma, clips[0].y.shape[1], orders[0])
    A, repaired = stabilised(A)
    deterministic, starts = fit_inputs(A, C, clips, None)
    for refit in range(REFITS + 1):
        rest = [clip.y - deterministic.simulate(clip.u, start) for clip, start in zip(clips, starts, strict=True)]
        functionals, correlations = predictor_space(rest, rows)
        stochastic, moved = realise(rest, rows, functionals, orders[1])
        if refit < REFITS:
            deterministic, starts = fit_inputs(A, C, clips, stochastic)
    return LinearSystem(deterministic, stochastic, starts, singular, correlations, repaired + moved)


def hankel_columns(clips: Sequence[Clip], rows: int) -> int:
    """How many positions the pair of windows (past, future) has in all clips together."""
    return sum(max(len(clip.u) - 2 * rows + 1, 0) for clip in clips)


def require_enough(clips: Sequence[Clip], rows: int, orders: tuple[int, int]) -> None:
    """FacesynthError unless there are 3 columns per row of the Hankel matrix, and rows for the orders."""
    m, p = clips[0].u.shape[1], clips[0].y.shape[1]
    needed, columns = 3 * 2 * rows * (m + p), hankel_columns(clips, rows)
    if columns < needed:
        raise FacesynthError(
            f"{sum(len(clip.u) for clip in clips)} frames in {len(clips)} clips are too few for {rows} block rows, {m} features "
            f"and {p} shape components: at least {needed + len(clips) * (2 * rows - 1)} frames are needed; "
            "record more, or lower the number of rows or components"
        )
    if (rows - 1) * p < orders[0] or rows * min(m, p) < max(orders[0], 1) or rows * p < orders[1]:
        raise FacesynthError(
            f"{rows} block rows of {p} shape components and {m} features cannot show {orders} states; raise rows"
        )


def frequencies(count: int) -> Array:
    """Points z [count] on the upper half of the unit circle, away from its ends, for comparing transfer functions."""
    return np.exp(1j * np.pi * (np.arange(count) + 0.5) / count)
