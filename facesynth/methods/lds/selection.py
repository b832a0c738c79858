"""What a user left to be chosen: the lead of the sound and the numbers of states, by the error on clips left out."""

from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np

from facesynth.methods.lds.identification import fitting_rows
from facesynth.methods.lds.orders import (
    Choice,
    Fold,
    deterministic_errors,
    folds,
    no_change_error,
    plainest_good,
    stochastic_errors,
)
from facesynth.methods.lds.stochastic import noise_rows
from facesynth.methods.lds.system import Array, Clip
from facesynth.progress import track

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

    def errors(lead_ms: float) -> Array:
        clips = clips_at(lead_ms)
        k = fitting_rows(clips, rows)
        order = min(LEAD_ORDER, *possible_orders(clips, k)[-1:])
        return deterministic_errors(folds(clips, sentences, k), k, [order], weights)

    return plainest_good(LEADS_MS, np.concatenate([errors(lead_ms) for lead_ms in track(LEADS_MS, "lead of the sound")]))


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
