"""From chosen nodes to frames: stretching, joining, silence, closed lips (Deng 2008, §6.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..efase.nodes import Floats, Ints, Nodes
from ..efase.soft import Mixture
from ..joints import smooth_joint
from ..phones import SILENCE
from ..warp import stretched, time_warp

FIRM = frozenset(["p", "b", "m", "f", "v", "w"])
LOOSE = frozenset(["k", "g", "ch", "ng", "r"])
SETTLE_S, WAKE_S = 0.25, 0.2


@dataclass(frozen=True, eq=False)
class Plan:
    """The result of a search."""

    nodes: Ints
    """[P] a node of the folder for each phone; -1 in silence."""
    cost: float
    mixtures: Sequence[Mixture | None] = ()
    """[P] nodes that may stand at each phone, None in silence; empty where only the cheapest path counts."""
    expected: Floats | None = None
    """[T, D] pose that the sound leads one to expect; None where nothing predicts it."""


@dataclass(frozen=True)
class Smoothing:
    """How joints are smoothed."""

    firm: float
    loose: float
    reach_s: float
    stiffness: float


def concatenate(
    nodes: Nodes, plan: Plan, phones: Sequence[str], bounds: Ints, rest: Floats, fps: float, smoothing: Smoothing
) -> Floats:
    """Coordinates [T, D]: bounds [P + 1] first frames of the phones, rest [P, D] the rest pose at each."""
    frames = np.zeros((bounds[-1], nodes.frames.shape[1]))
    path, mixtures = plan.nodes, plan.mixtures or [None] * len(phones)
    spoken = np.array([phone != SILENCE for phone in phones])
    for t in np.flatnonzero(spoken & (np.diff(bounds) > 0)).tolist():
        start, stop, mixture = int(bounds[t]), int(bounds[t + 1]), mixtures[t]
        frames[start:stop] = (
            np.tensordot(mixture.shares, stretched(nodes, mixture.nodes, stop - start), 1)
            if mixture
            else time_warp(nodes.motion(int(path[t])), stop - start)
        )
    kind = [smoothing.firm if phone in FIRM else smoothing.loose if phone in LOOSE else 1.0 for phone in phones]
    weights = np.repeat(kind, np.diff(bounds))
    reach, stiffness = max(3, round(smoothing.reach_s * fps)), smoothing.stiffness * (fps / 120) ** 3
    for t in range(1, len(path)):
        mixture = mixtures[t]
        strength = 1 - mixture.captured if mixture else float(nodes.before[path[t]] != path[t - 1])
        if not (spoken[t] and spoken[t - 1]) or strength <= 0:
            continue
        # The phone that holds the joint's frame: one too short for a frame hands the joint on to the next.
        holder = int(np.searchsorted(bounds, bounds[t], side="right")) - 1
        if 0 < holder < len(path):
            inside = min(reach, int(bounds[holder] - bounds[holder - 1]), int(bounds[holder + 1] - bounds[holder]))
            if inside > 0:
                frames = smooth_joint(frames, int(bounds[t]), inside, weights, stiffness, strength)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], ~spoken, [False]]).astype(int)))
    for first, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if plan.expected is None:
            _fill_silence(frames, int(bounds[first]), int(bounds[stop]), rest[first], fps)
        else:
            _follow(frames, int(bounds[first]), int(bounds[stop]), plan.expected, fps)
    return frames


def _fill_silence(frames: Floats, start: int, stop: int, rest: Floats, fps: float) -> None:
    """A short silence is bridged; a long one, or one at an edge, goes through the rest pose."""
    settle, wake = round(SETTLE_S * fps), round(WAKE_S * fps)
    at_start, at_end = start == 0, stop == len(frames)
    if stop <= start:
        return
    before, after = rest if at_start else frames[start - 1], rest if at_end else frames[stop]
    count = stop - start
    k = np.arange(1, count + 1)[:, None]
    if at_start or at_end or count > settle + wake:
        leave = np.zeros((count, 1)) if at_end else _ease((k - (count + 1 - wake)) / wake)
        arrive = np.ones((count, 1)) if at_start else _ease(k / settle)
        frames[start:stop] = (1 - leave) * ((1 - arrive) * before + arrive * rest) + leave * after
    else:
        share = _ease(k / (count + 1))
        frames[start:stop] = (1 - share) * before + share * after


def _follow(frames: Floats, start: int, stop: int, expected: Floats, fps: float) -> None:
    """Silence as expected; how far speech was from that at either side fades as fast as the face settles and wakes."""
    count = stop - start
    if count <= 0:
        return
    k = np.arange(1, count + 1)[:, None]
    frames[start:stop] = expected[start:stop]
    if start > 0:
        leave = _ease(k / min(round(SETTLE_S * fps), count + 1))
        frames[start:stop] += (1 - leave) * (frames[start - 1] - expected[start - 1])
    if stop < len(frames):
        arrive = _ease((count + 1 - k) / min(round(WAKE_S * fps), count + 1))
        frames[start:stop] += (1 - arrive) * (frames[stop] - expected[stop])


def _ease(u: NDArray[np.float64]) -> Floats:
    u = np.clip(u, 0, 1)
    return u * u * (3 - 2 * u)
