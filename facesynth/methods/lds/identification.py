"""From recordings to a linear system: the orthogonal decomposition, step by step."""

from collections.abc import Sequence

import numpy as np

from facesynth.inference.errors import FacesynthError
from facesynth.methods.lds.deterministic import fit_inputs, observability, shift_invariance, stabilised
from facesynth.methods.lds.stochastic import FEWEST_ROWS, noise_rows, predictor_space, realise
from facesynth.methods.lds.system import Array, Clip, LinearSystem

REFITS = 2
"""How often the deterministic part is fitted again with the noise model known."""


def identify(clips: Sequence[Clip], rows: int, orders: tuple[int, int], refits: int = REFITS) -> LinearSystem:
    """A system with `orders` = (deterministic, stochastic) states from clips of any lengths.

    `rows` is k, the number of block rows: how many frames of past and of future are compared.
    Signals should have zero mean and comparable scale. The stochastic part is identified from what
    the deterministic part leaves of the output and not from the projection that is orthogonal
    to the inputs, because that projection still holds deterministic state that a finite window cannot see.
    `refits`: how often the deterministic part is fitted again through the inverse noise model, which is best where the
    recordings come from such a system; 0 leaves it what follows the recordings best when it runs by itself.
    """
    past = noise_rows(sum(len(clip.y) for clip in clips), rows, clips[0].y.shape[1])
    require_rows_for(orders, (rows, past), clips[0].u.shape[1], clips[0].y.shape[1])
    gamma, singular = observability(clips, rows)
    A, C = shift_invariance(gamma, clips[0].y.shape[1], orders[0])
    A, repaired = stabilised(A)
    deterministic, starts = fit_inputs(A, C, clips, None)
    for refit in range(refits + 1):
        rest = [clip.y - deterministic.simulate(clip.u, start) for clip, start in zip(clips, starts, strict=True)]
        functionals, correlations = predictor_space(rest, past)
        stochastic, moved = realise(rest, past, functionals, orders[1])
        if refit < refits:
            deterministic, starts = fit_inputs(A, C, clips, stochastic)
    return LinearSystem(deterministic, stochastic, starts, singular, correlations, repaired + moved)


def hankel_columns(lengths: Sequence[int], rows: int) -> int:
    """How many positions the pair of windows (past, future) has in clips of these lengths together."""
    return sum(max(length - 2 * rows + 1, 0) for length in lengths)


def fitting_rows(clips: Sequence[Clip], wanted: int) -> int:
    """The largest number of block rows up to `wanted` that the recording has frames for.

    That is three columns of the Hankel matrix for each of its rows; FacesynthError where not even two block rows have them.
    """
    lengths = [len(clip.u) for clip in clips]
    m, p = clips[0].u.shape[1], clips[0].y.shape[1]
    for rows in range(wanted, FEWEST_ROWS - 1, -1):
        if hankel_columns(lengths, rows) >= 3 * 2 * rows * (m + p):
            return rows
    needed = 3 * 2 * FEWEST_ROWS * (m + p) + len(lengths) * (2 * FEWEST_ROWS - 1)
    raise FacesynthError(
        f"{sum(lengths)} frames in {len(lengths)} clips are too few for {m} features of the sound and {p} components of the "
        f"shape: at least {needed} frames are needed; record more, or keep fewer features and components"
    )


def require_rows_for(orders: tuple[int, int], rows: tuple[int, int], m: int, p: int) -> None:
    """FacesynthError where Hankel matrices of so many block rows (deterministic, stochastic) cannot show so many states."""
    most = min((rows[0] - 1) * p, rows[0] * m), rows[1] * p
    if not (1 <= orders[0] <= most[0] and 1 <= orders[1] <= most[1]):
        raise FacesynthError(
            f"{orders[0]} deterministic and {orders[1]} stochastic states do not fit: with {rows[0]} and {rows[1]} block rows, "
            f"{m} features and {p} components there can be 1 to {most[0]} and 1 to {most[1]}; lower the orders, raise rows, or "
            "record more"
        )


def frequencies(count: int) -> Array:
    """Points z [count] on the upper half of the unit circle, away from its ends, for comparing transfer functions."""
    return np.exp(1j * np.pi * (np.arange(count) + 0.5) / count)
