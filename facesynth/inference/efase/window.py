"""A part of the motion alone, from the phones around it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..arrays import Ints
from ..efase.plan import Plan
from ..filters import at_rate
from ..phones import SILENCE
from ..speech import Speech

if TYPE_CHECKING:
    from ..efase.model import Efase

REACH_S = 0.6
"""Sharpening reaches 0.4 s, the smoothing of weak emotions 0.32 s, that of joints less."""
REACH_FRAMES = 6
"""How far a filter for another rate reaches beyond that, in frames of the lower one."""


def window(model: Efase, plans: Sequence[Plan], speech: Speech, first: int, stop: int) -> NDArray[np.float32]:
    """Frames first … stop - 1 of the whole, at the model's rate."""
    fps, ratio = model.database_fps, model.database_fps / model.fps
    bounds, labels = speech.phones.frame_bounds(fps), speech.phones.labels
    reach = REACH_S * fps + REACH_FRAMES * max(ratio, 1.0)
    own = phones_around(labels, bounds, first * ratio - reach, stop * ratio + reach)
    feelings, intensity = speech.emotions.per_phone(speech.phones)
    zero, end = int(bounds[own.start]), int(bounds[own.stop])
    parts = [_part(plan, own, slice(zero, end)) for plan in plans]
    around = bounds[own.start : own.stop + 1] - zero
    frames = model.frames(parts, labels[own], feelings[own], intensity[own], around)
    made = frames_between(frames, zero, int(bounds[-1]), fps, first, stop, model.fps)
    if model.layout.kind == "curves":
        made = np.clip(made, frames.min(axis=0), frames.max(axis=0))
    beside = model.beside_lips(speech, model.fps, int(speech.phones.frame_bounds(model.fps)[-1]))
    return (made + beside[np.minimum(np.arange(first, stop), len(beside) - 1)]).astype(np.float32)


def frames_between(
    frames: NDArray[np.float64], zero: int, count: int, fps: float, first: int, stop: int, new_fps: float
) -> NDArray[np.float64]:
    """Frames first … stop - 1 of the whole at another rate, of those from `zero` on [T, C] of a whole of `count` frames."""
    if fps == new_fps:
        return frames[np.minimum(np.arange(first, stop), count - 1) - zero]
    there = np.minimum(np.arange(first, stop), max(round(count / fps * new_fps), 1) - 1)
    return at_rate(frames, fps, new_fps, np.minimum(there * fps / new_fps, count - 1) - zero)


def phones_around(labels: Sequence[str], bounds: Ints, first: float, stop: float) -> slice:
    """Phones of the frames first … stop; they begin and end in speech, for how silence moves depends on what is beside it."""
    shown = (np.array(labels) != SILENCE) & (np.diff(bounds) > 0)
    start = max(int(np.searchsorted(bounds, first, side="right")) - 1, 0)
    end = min(max(int(np.searchsorted(bounds, stop, side="left")), start + 1), len(labels))
    while start > 0 and not shown[start]:
        start -= 1
    while end < len(labels) and not shown[end - 1]:
        end += 1
    return slice(start, end)


def _part(plan: Plan, own: slice, frames: slice) -> Plan:
    """The plan of some of the phones, which are these frames."""
    return replace(
        plan,
        nodes=plan.nodes[own],
        mixtures=None if plan.mixtures is None else plan.mixtures[own],
        expected=None if plan.expected is None else plan.expected[frames],
    )
