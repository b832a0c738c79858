"""From a path of nodes to frames: stretching, joining, smoothing, and what the face does in silence."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Ints
from ..filters import gaussian
from ..long_arrays import Growing, let_go, row_blocks
from ..phones import SILENCE
from ..warp import time_warp
from .nodes import Nodes
from .soft import Mixture, mean_motion


def smooth_joint(frames: Floats, joint: int, reach: int, weights: Floats, stiffness: float = 1.0, strength: float = 1.0) -> None:
    """Smooth, in frames [T, D], a share `strength` of the jump between `joint - 1` and `joint` over `reach` frames each way.

    `min_g sum_k w_k (g_k - f_k)² + stiffness · ∫ g''²` (Deng 2008, eq. 13), a weighted cubic smoothing
    spline over the frame numbers; weights [T], large where a frame must stay. The correction g - f
    fades to 0 at the outer frames, since the spline would otherwise leave a new step there.
    """
    first, stop = max(joint - reach, 0), min(joint + reach, len(frames))
    piece = frames[first:stop]
    if len(piece) < 3:
        return
    spline = smoothing_spline if len(piece) >= 5 else _penalised
    correction = spline(piece, weights[first:stop], stiffness) - piece
    rise = np.clip(np.arange(len(piece)) / max(joint - first - 1, 1), 0, 1)
    fall = np.clip(np.arange(len(piece))[::-1] / max(stop - joint - 1, 1), 0, 1)
    frames[first:stop] += strength * np.minimum(rise, fall)[:, None] * correction


def smoothing_spline(piece: Floats, weights: Floats, stiffness: float) -> Floats:
    """Frames [n, C], n >= 5, of `min sum w_k (g_k - f_k)² + stiffness ∫ g''²`, the natural cubic smoothing spline (Reinsch)."""
    count = len(piece)
    Q = np.zeros((count, count - 2))
    k = np.arange(count - 2)
    Q[k, k], Q[k + 1, k], Q[k + 2, k] = 1.0, -2.0, 1.0
    R = np.diag(np.full(count - 2, 2 / 3)) + np.diag(np.full(count - 3, 1 / 6), 1) + np.diag(np.full(count - 3, 1 / 6), -1)
    spread = Q / weights[:, None]
    return np.asarray(piece - stiffness * spread @ np.linalg.solve(R + stiffness * Q.T @ spread, Q.T @ piece))


def _penalised(piece: Floats, weights: Floats, stiffness: float) -> Floats:
    """The same with second differences for the derivative, where there are too few frames for a spline."""
    bend = np.diff(np.eye(len(piece)), n=2, axis=0)
    return np.asarray(np.linalg.solve(np.diag(weights) + stiffness * bend.T @ bend, weights[:, None] * piece))


FIRM = frozenset(["p", "b", "m", "f", "v", "w"])
"""Phones whose shape must survive the smoothing (Deng 2008, §6.3)."""
LOOSE = frozenset(["k", "g", "ch", "ng", "r"])
SETTLE_S = 0.25
"""How long the face takes to its rest pose."""
WAKE_S = 0.2
"""How long before speech it leaves that pose."""
"""The emotion that weak ones are blended with."""
SMOOTH_S = 0.08
"""Standard deviation of what intensities of emotion are smoothed with."""


@dataclass(frozen=True)
class Smoothing:
    """How joints are smoothed."""

    firm: float = 2.0
    loose: float = 0.5
    reach_s: float = 0.025
    """Frames on either side of a joint, at least three."""
    stiffness: float = 1.0
    """Weight of the bending term at 120 Hz."""


def concatenate(
    nodes: Nodes,
    path: Ints,
    phones: Sequence[str],
    bounds: Ints,
    rest: Floats,
    fps: float,
    smoothing: Smoothing,
    mixtures: Sequence[Mixture | None] | None = None,
    expected: Floats | None = None,
) -> Floats:
    """Frames [T, D] of one search result.

    path [P] a node for each phone (ignored where it is `pau`), bounds [P + 1] first frames of the
    phones, rest [P, D] the rest pose at each phone. Where there are mixtures [P], each phone is the mean
    of its time-warped nodes, and a joint is smoothed as far as it is probably none that was captured. Where
    a pose is expected of each frame [T, D], silence follows it instead of resting.
    """
    frames = np.zeros((bounds[-1], nodes.frames.shape[1]))
    spoken = np.array([phone != SILENCE for phone in phones])
    for t in np.flatnonzero(spoken & (np.diff(bounds) > 0)).tolist():
        start, stop = int(bounds[t]), int(bounds[t + 1])
        mixture = mixtures[t] if mixtures is not None else None
        frames[start:stop] = (
            mean_motion(nodes, mixture, stop - start) if mixture else time_warp(nodes.motion(int(path[t])), stop - start)
        )
    _smooth_joints(frames, nodes, path, phones, bounds, fps, smoothing, mixtures)
    for first, stop in _runs(~spoken):
        if expected is None:
            _fill_silence(frames, int(bounds[first]), int(bounds[stop]), rest[first], fps)
        else:
            _follow(frames, int(bounds[first]), int(bounds[stop]), expected, fps)
    return frames


def joints(nodes: Nodes, path: Ints, phones: Sequence[str], bounds: Ints) -> Ints:
    """First frames of phones that were not captured right after the phone before them."""
    jumps = [
        bounds[t]
        for t in range(1, len(path))
        if phones[t] != SILENCE and phones[t - 1] != SILENCE and nodes.before[path[t]] != path[t - 1]
    ]
    return np.array(jumps, np.int64)


def _smooth_joints(
    frames: Floats,
    nodes: Nodes,
    path: Ints,
    phones: Sequence[str],
    bounds: Ints,
    fps: float,
    smoothing: Smoothing,
    mixtures: Sequence[Mixture | None] | None,
) -> None:
    weight = {**dict.fromkeys(FIRM, smoothing.firm), **dict.fromkeys(LOOSE, smoothing.loose)}
    weights = np.repeat([weight.get(phone, 1.0) for phone in phones], np.diff(bounds))
    reach = max(3, round(smoothing.reach_s * fps))
    stiffness = smoothing.stiffness * (fps / 120) ** 3
    for t in range(1, len(path)):
        strength = _jump(nodes, path, phones, mixtures, t)
        place = int(np.searchsorted(bounds, bounds[t], side="right")) - 1  # t, or the phone after those without frames
        if strength <= 0 or place >= len(path):
            continue
        inside = min(reach, int(bounds[place] - bounds[place - 1]), int(bounds[place + 1] - bounds[place]))
        if inside > 0:
            smooth_joint(frames, int(bounds[t]), inside, weights, stiffness, strength)


def _jump(nodes: Nodes, path: Ints, phones: Sequence[str], mixtures: Sequence[Mixture | None] | None, t: int) -> float:
    """Probability that phone t was not captured right after the phone before it; 0 beside silence."""
    if SILENCE in (phones[t - 1], phones[t]):
        return 0.0
    mixture = mixtures[t] if mixtures is not None else None
    return 1 - mixture.captured if mixture else float(nodes.before[path[t]] != path[t - 1])


def _runs(silent: np.ndarray) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], silent, [False]]).astype(int)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _fill_silence(frames: Floats, start: int, stop: int, rest: Floats, fps: float) -> None:
    """Between words a short silence is bridged; a long one, or one at an edge, goes through the rest pose.

    Everything follows 3u² - 2u³, which starts and ends without velocity.
    """
    settle, wake = round(SETTLE_S * fps), round(WAKE_S * fps)
    at_start, at_end = start == 0, stop == len(frames)
    if stop <= start:
        return
    before = rest if at_start else frames[start - 1]
    after = rest if at_end else frames[stop]
    count = stop - start
    k = np.arange(1, count + 1)[:, None]
    if at_start or at_end or count > settle + wake:
        leave = np.zeros_like(k, float) if at_end else _ease((k - (count + 1 - wake)) / wake)
        arrive = np.ones_like(k, float) if at_start else _ease(k / settle)
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


def _ease(u: Floats) -> Floats:
    u = np.clip(u, 0, 1)
    return u * u * (3 - 2 * u)


def blend(neutral: Floats, expressive: Floats, intensity: Floats, bounds: Ints, fps: float) -> Floats:
    """`x_neutral + I(t) (x_emotion - x_neutral)`, frames [T, C], intensity [P] of each phone, smoothed over time.

    Between neutral and full emotion (named as missing in Deng 2008).
    """
    share = gaussian(np.repeat(intensity, np.diff(bounds)), SMOOTH_S * fps)[:, None]
    parts = Growing(np.float64)
    for rows in row_blocks(neutral):
        parts.add(neutral[rows] + share[rows] * (expressive[rows] - neutral[rows]))
        let_go(expressive)
    return parts.whole()
