"""From chosen nodes to one continuous motion: time-warp and blending (Cao 2005, §4.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..anime_graph.graph import Candidates, Nodes, Wish
from ..anime_graph.hearing import Floats, Ints, warp_path, warp_paths
from ..filters import gaussian
from ..warp import time_warp

VELOCITY_LASTS_S = 0.04
WARP_SMOOTHING = 2.0


@dataclass(frozen=True, eq=False)
class Piece:
    """One phone of the output: the node that expresses it, brought to the phone's frames."""

    emotion: int
    node: int
    map: int
    wanted: Floats
    """[m, P]"""
    motion: Floats
    """[n, D]"""


def make_piece(nodes: Nodes, wish: Wish, candidates: Candidates, chosen: int) -> Piece:
    """The chosen node, time-warped to the phone."""
    node, number = int(candidates.nodes[chosen]), int(candidates.maps[chosen])
    motion = warped(nodes.motion(node, number), wish.wanted, nodes.audio(node), wish.frames)
    return Piece(wish.emotion, node, number, wish.wanted, motion)


def likely_motions(nodes: Nodes, wish: Wish, candidates: Candidates, likely: Ints) -> Floats:
    """[n, frames, D] some candidates of a phone, time-warped to it."""
    chosen = candidates.nodes[likely].tolist()
    heard = [nodes.audio(node) for node in chosen]
    motions = [nodes.motion(node, number) for node, number in zip(chosen, candidates.maps[likely].tolist(), strict=True)]
    together = wish.frames > 1 and len(wish.wanted) > 1
    paths = warp_paths(wish.wanted, heard) if together else [None] * len(heard)
    each = zip(motions, heard, paths, strict=True)
    return np.stack([warped(motion, wish.wanted, sound, wish.frames, path) for motion, sound, path in each])


def warped(motion: Floats, wanted: Floats, heard: Floats, count: int, path: Floats | None = None) -> Floats:
    """Motion [L, D] that sounded like heard [L', P], brought to `count` frames of speech like wanted [m, P].

    path: where warping matches them, if that is known.
    """
    if count == 0:
        return motion[:0]
    if count == 1 or len(wanted) < 2 or len(heard) < 2:
        return time_warp(motion, count)
    even = np.linspace(0, 1, len(wanted))
    path = (warp_path(wanted, heard) if path is None else path) / (len(heard) - 1)
    path[0], path[-1] = 0.0, 1.0
    departure = path - even
    margin = min(len(departure) - 1, round(4 * WARP_SMOOTHING))
    smooth = gaussian(np.pad(departure, margin, mode="reflect", reflect_type="odd"), WARP_SMOOTHING)
    smooth = smooth[margin : margin + len(departure)]
    smooth[0] = smooth[-1] = 0.0
    place = np.interp(np.linspace(0, 1, count), even, even + smooth) * (len(motion) - 1)
    low = np.clip(place.astype(np.int64), 0, max(len(motion) - 2, 0))
    share = (place - low)[:, None]
    return (1 - share) * motion[low] + share * motion[np.minimum(low + 1, len(motion) - 1)]


class Blender:
    """Pieces in, blended pieces out; a piece is final when the next two are known."""

    def __init__(self, nodes: Nodes, fps: float, help_pairs: bool) -> None:
        self.nodes, self.fps, self.help_pairs = nodes, fps, help_pairs
        self.pieces: list[Piece] = []
        self.jumps: list[bool] = []
        self._joins: dict[int, tuple[Floats, Floats]] = {}

    def add(self, piece: Piece, captured: bool) -> None:
        """The next piece; `captured`: it was recorded right after the one before."""
        self.jumps.append(bool(self.pieces) and not captured)
        self.pieces.append(piece)

    def blended(self, t: int) -> Floats:
        """[n, D] piece t with the joins on both of its sides; those that are not known yet count as captured."""
        motion = self.pieces[t].motion
        if self._jumped(t):
            motion = motion + self._join(t)[1]
        if self._jumped(t + 1):
            motion = motion + self._join(t + 1)[0]
        return motion

    def _jumped(self, t: int) -> bool:
        return 0 <= t < len(self.jumps) and self.jumps[t]

    def _join(self, t: int) -> tuple[Floats, Floats]:
        """What is added to the pieces on the left and on the right of a jump."""
        if t not in self._joins:
            left, right = self.pieces[t - 1], self.pieces[t]
            shared = (self._jumped(t - 1), self._jumped(t + 1))
            helped = self._help(left, right) if self.help_pairs else None
            self._joins[t] = self._extend(left, right, shared) if helped is None else _helped(left, right, helped, shared)
        return self._joins[t]

    def _help(self, left: Piece, right: Piece) -> tuple[Floats, Floats] | None:
        """The recorded transition between these phones, warped to both pieces' timing, if there is one."""
        of = self.nodes
        nodes = np.flatnonzero((of.phones == of.phones[left.node]) & (of.after >= 0))
        nodes = nodes[of.phones[of.after[nodes]] == of.phones[right.node]]
        if not len(nodes):
            return None
        nodes, maps = next(of.by_emotion(nodes, left.emotion))
        cost = of.sound_costs(left.wanted, nodes) + of.sound_costs(right.wanted, of.after[nodes])
        pairs = []
        for k in np.flatnonzero(cost <= cost.min() + 1e-9):
            both = ((left, int(nodes[k])), (right, int(of.after[nodes[k]])))
            pairs.append([warped(of.motion(n, int(maps[k])), p.wanted, of.audio(n), len(p.motion)) for p, n in both])
        best = min(pairs, key=lambda pair: _ends_apart(pair, left, right))
        return best[0], best[1]

    def _extend(self, left: Piece, right: Piece, shared: tuple[bool, bool]) -> tuple[Floats, Floats]:
        """Cross-fade of the left node continued and the right node begun earlier, linear over both pieces."""
        p, q = len(left.motion), len(right.motion)
        of = self.nodes
        onward = _prolonged(left.motion, of.mapped(of.following(left.node, q), left.map), q, self.fps)
        earlier = of.mapped(of.preceding(right.node, p), right.map)
        backward = _prolonged(right.motion[::-1], earlier[::-1], p, self.fps)[::-1]
        start, stop = p // 2 if shared[0] else 0, q // 2 if shared[1] else q
        rise = np.clip((np.arange(p + q) - start + 0.5) / max(p + stop - start, 1), 0.0, 1.0)
        return rise[:p, None] * (backward - left.motion), (1 - rise[p:, None]) * (onward - right.motion)


def _helped(left: Piece, right: Piece, pair: tuple[Floats, Floats], shared: tuple[bool, bool]) -> tuple[Floats, Floats]:
    rise, fall = _rising(len(left.motion), shared[0]), _rising(len(right.motion), shared[1])[::-1]
    return rise[:, None] * (pair[0] - left.motion), fall[:, None] * (pair[1] - right.motion)


def _rising(count: int, shared: bool) -> Floats:
    return np.linspace(0.0, 1.0, count) if count > 1 else np.full(count, 0.5 if shared else 1.0)


def _ends_apart(pair: list[Floats], left: Piece, right: Piece) -> float:
    return float(np.linalg.norm(pair[0][:1] - left.motion[:1]) + np.linalg.norm(pair[1][-1:] - right.motion[-1:]))


def _prolonged(motion: Floats, recorded: Floats, count: int, fps: float) -> Floats:
    """`count` frames after motion [n, D]: the recorded ones, then the last velocity, running out."""
    known = np.concatenate([motion[-2:], recorded])
    missing = count - len(recorded)
    if missing <= 0 or not len(known):
        return recorded[:count] if len(known) else np.zeros((count, motion.shape[1]))
    velocity = known[-1] - known[-2] if len(known) > 1 else np.zeros(motion.shape[1])
    lasting = VELOCITY_LASTS_S * fps
    travelled = lasting * (1 - np.exp(-np.arange(1, missing + 1) / lasting))
    return np.concatenate([recorded, known[-1] + travelled[:, None] * velocity])
