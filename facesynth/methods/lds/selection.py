"""What a user left to be chosen: the lead of the sound and the numbers of states, by the error on clips left out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np

from facesynth.methods.lds.identification import fitting_rows
from facesynth.methods.lds.orders import Choice, deterministic_errors, folds, plainest_good, stochastic_errors
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
) -> tuple[Choice, Choice]:
    """The numbers of deterministic and of stochastic states."""
    parts = folds(clips, sentences, rows)
    orders = possible_orders(clips, rows)
    deterministic = _given(wanted[0]) or plainest_good(orders, deterministic_errors(parts, rows, orders, weights))
    chosen = int(deterministic.chosen)
    return deterministic, _given(wanted[1]) or plainest_good(orders, stochastic_errors(parts, rows, chosen, orders, weights))


def possible_orders(clips: Sequence[Clip], rows: int) -> list[int]:
    """Candidates that the Hankel matrices can show with rows to spare."""
    width = min(clips[0].u.shape[1], clips[0].y.shape[1])
    return [order for order in ORDERS if order <= max(1, (rows - 1) * width // 2)]


def plain(choice: Choice) -> dict[str, Any]:
    """For JSON."""
    return {"candidates": list(choice.candidates), "errors": list(choice.errors), "chosen": choice.chosen}


def _given(wanted: int | Auto) -> Choice | None:
    return None if wanted == "auto" else Choice((), (), wanted)
