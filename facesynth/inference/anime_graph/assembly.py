"""From chosen nodes to one continuous motion: time-warp and blending (Cao 2005, §4.3)."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Ints
from ..filters import gaussian
from ..long_arrays import joined
from ..warp import time_warp
from .audio_cost import warp_path, warp_paths
from .candidates import Candidates, Chooser
from .plan import Plan, Wish

VELOCITY_LASTS_S = 0.04
"""Time constant with which an extrapolated movement comes to rest."""
WARP_SMOOTHING = 2.0
"""Standard deviation, in feature frames, of the smoothing of a time-warp."""
LATER = 2
"""Pieces after one that must be known before its frames are: the next one's other join decides how it is bridged."""
LEAST_SHARE = 1e-3
"""Candidates that are less probable than this are left out of a mean."""


@dataclass(frozen=True, eq=False)
class Piece:
    """One phone of the output: the node that expresses it, brought to the phone's frames."""

    emotion: int
    """Index of the input's emotion."""
    node: int
    map: int
    """Number of the emotion map that its motion went through, or -1."""
    wanted: Floats
    """[m, P] the input's audio features."""
    motion: Floats
    """[n, D] time-warped motion."""


@dataclass(frozen=True, eq=False)
class Join:
    """How a jump is bridged: what is added to the unblended motion of the pieces on both sides."""

    how: str
    """`help` or `extension`."""
    left: Floats
    """[n, D]"""
    right: Floats
    """[n', D]"""


def make_piece(chooser: Chooser, wish: Wish, candidates: Candidates, chosen: int) -> Piece:
    """The chosen node, time-warped to the phone."""
    node, number = int(candidates.nodes[chosen]), int(candidates.maps[chosen])
    motion = warped(chooser.motion(node, number), wish.wanted, chooser.graph.audio(node), wish.frames)
    return Piece(wish.emotion, node, number, wish.wanted, motion)


def likely_motions(chooser: Chooser, wish: Wish, candidates: Candidates, likely: Ints) -> Floats:
    """[n, frames, D] some candidates of a phone, time-warped to it."""
    chosen, numbers = candidates.nodes[likely].tolist(), candidates.maps[likely].tolist()
    heard = [chooser.graph.audio(node) for node in chosen]
    motions = [chooser.motion(node, number) for node, number in zip(chosen, numbers, strict=True)]
    together = wish.frames > 1 and len(wish.wanted) > 1
    paths: Sequence[Floats | None] = warp_paths(wish.wanted, heard) if together else [None] * len(heard)
    each = zip(motions, heard, paths, strict=True)
    return np.stack([warped(motion, wish.wanted, sound, wish.frames, path) for motion, sound, path in each])


def warped(motion: Floats, wanted: Floats, heard: Floats, count: int, path: Floats | None = None) -> Floats:
    """Motion [L, D] of a node that sounded like heard [L', P], brought to `count` frames of speech like wanted [m, P].

    DTW of the audio says which moment of the node belongs to which moment of the input; `path` is what it says, if that
    is known. The ends are held, and the departure from even timing is smoothed; smoothing of a monotone path, continued
    oddly at its ends, is monotone.
    """
    if count == 0:
        return motion[:0]
    if count == 1 or len(wanted) < 2 or len(heard) < 2:
        return time_warp(motion, count)
    even = np.linspace(0, 1, len(wanted))
    path = (warp_path(wanted, heard) if path is None else path) / (len(heard) - 1)
    path[0], path[-1] = 0.0, 1.0
    place = np.interp(np.linspace(0, 1, count), even, even + _smooth_between_zeros(path - even)) * (len(motion) - 1)
    low = np.clip(place.astype(np.int64), 0, max(len(motion) - 2, 0))
    share = (place - low)[:, None]
    return np.asarray((1 - share) * motion[low] + share * motion[np.minimum(low + 1, len(motion) - 1)])


def _smooth_between_zeros(departure: Floats) -> Floats:
    margin = min(len(departure) - 1, round(4 * WARP_SMOOTHING))
    padded = np.pad(departure, margin, mode="reflect", reflect_type="odd")
    smooth = gaussian(padded, WARP_SMOOTHING)[margin : margin + len(departure)]
    smooth[0] = smooth[-1] = 0.0
    return smooth


class Blender:
    """Pieces in, blended pieces out; a piece is final when the next two are known."""

    def __init__(self, chooser: Chooser, fps: float, *, help_pairs: bool = True) -> None:
        self.chooser, self.fps, self.help_pairs = chooser, fps, help_pairs
        self.pieces: dict[int, Piece] = {}
        """By their number, without those that no frame depends on any more."""
        self.jumps: list[bool] = []
        """For each piece whether it was jumped to."""
        self.joins: dict[int, Join] = {}
        """By the piece on the right."""

    def add(self, piece: Piece, captured: bool) -> None:
        """The next piece; `captured`: it was recorded right after the one before."""
        self.jumps.append(bool(self.jumps) and not captured)
        self.pieces[len(self.jumps) - 1] = piece

    def blended(self, t: int) -> Floats:
        """[n, D] piece t with the joins on both of its sides; those that are not known yet count as captured."""
        motion = self.pieces[t].motion
        if self._jumped(t):
            motion = motion + self._join(t).right
        if self._jumped(t + 1):
            motion = motion + self._join(t + 1).left
        return motion

    def final(self, t: int) -> Floats:
        """`blended`, of which the next two pieces are known; what lies before it is forgotten, as it is not asked for again."""
        motion = self.blended(t)
        self.pieces.pop(t - 1, None)
        self.joins.pop(t, None)
        return motion

    def _jumped(self, t: int) -> bool:
        return 0 <= t < len(self.jumps) and self.jumps[t]

    def _join(self, t: int) -> Join:
        if t not in self.joins:
            shared = self._jumped(t - 1), self._jumped(t + 1)
            self.joins[t] = self.bridge(self.pieces[t - 1], self.pieces[t], shared)
        return self.joins[t]

    def bridge(self, left: Piece, right: Piece, shared: tuple[bool, bool]) -> Join:
        """The join of two pieces that were not recorded one after the other.

        `shared` tells whether the left and the right piece also end in a jump on their other side; a fade between
        extensions then keeps to the half of it that is nearer.
        """
        helped = self._help(left, right) if self.help_pairs else None
        if helped is None:
            return self._extension(left, right, shared)
        rise, fall = _rising(len(left.motion), shared[0]), _rising(len(right.motion), shared[1])[::-1]
        return Join("help", rise[:, None] * (helped[0] - left.motion), fall[:, None] * (helped[1] - right.motion))

    def _help(self, left: Piece, right: Piece) -> tuple[Floats, Floats] | None:
        """The recorded transition between these phones, warped to both pieces' timing, if the graph has one.

        Among several in the best available emotion: the least audio cost, then the nearest end points.
        """
        chooser, graph = self.chooser, self.chooser.graph
        nodes = np.flatnonzero((graph.phones == graph.phones[left.node]) & (graph.after >= 0))
        nodes = nodes[graph.phones[graph.after[nodes]] == graph.phones[right.node]]
        if not len(nodes):
            return None
        _, nodes, maps = next(chooser.by_emotion(nodes, left.emotion))
        cost = chooser.sound_costs(left.wanted, nodes) + chooser.sound_costs(right.wanted, graph.after[nodes])
        tied = np.flatnonzero(cost <= cost.min() + 1e-9)
        pairs = [self._help_pair(left, right, int(nodes[k]), int(maps[k])) for k in tied]
        return min(pairs, key=lambda pair: _ends_apart(pair, left, right))

    def _help_pair(self, left: Piece, right: Piece, node: int, number: int) -> tuple[Floats, Floats]:
        graph = self.chooser.graph
        m, n = (
            warped(self.chooser.motion(of, number), piece.wanted, graph.audio(of), len(piece.motion))
            for piece, of in ((left, node), (right, int(graph.after[node])))
        )
        return m, n

    def _extension(self, left: Piece, right: Piece, shared: tuple[bool, bool]) -> Join:
        """Cross-fade of the left node continued and the right node begun earlier, linear over both pieces.

        As many frames as the other piece has are taken from the recording; where it ends, the movement runs out.
        """
        p, q, of = len(left.motion), len(right.motion), self.chooser
        onward = _prolonged(left.motion, of.maps.through(of.graph.following(left.node, q), left.map), q, self.fps)
        earlier = of.maps.through(of.graph.preceding(right.node, p), right.map)
        backward = _prolonged(right.motion[::-1], earlier[::-1], p, self.fps)[::-1]
        rise = _fade(p // 2 if shared[0] else 0, p, q // 2 if shared[1] else q, q)
        return Join("extension", rise[:p, None] * (backward - left.motion), (1 - rise[p:, None]) * (onward - right.motion))


def blend(chooser: Chooser, plan: Plan, blender: Blender) -> Floats:
    """[frames, D] blended motion of a plan, not yet smoothed."""
    return joined(_blended(chooser, plan, blender), np.float64)


def _blended(chooser: Chooser, plan: Plan, blender: Blender) -> Iterator[Floats]:
    captured = [False, *(~plan.jumps).tolist()]
    for t, recorded in enumerate(captured):
        blender.add(make_piece(chooser, plan.wishes[t], plan.candidates[t], int(plan.path[t])), recorded)
        if t >= LATER:
            yield blender.final(t - LATER)
    yield from (blender.final(t) for t in range(max(0, len(captured) - LATER), len(captured)))


def mean_motion(chooser: Chooser, plan: Plan, shares_of: Sequence[Floats]) -> Floats:
    """[frames, D] each phone the mean of its candidates by their shares [n], brought to its time; not yet smoothed."""
    return joined(_means(chooser, plan, shares_of), np.float64)


def _means(chooser: Chooser, plan: Plan, shares_of: Sequence[Floats]) -> Iterator[Floats]:
    for wish, candidates, shares in zip(plan.wishes, plan.candidates, shares_of, strict=True):
        likely = np.flatnonzero(shares >= min(LEAST_SHARE, shares.max()))
        pieces = likely_motions(chooser, wish, candidates, likely)
        yield np.asarray(np.tensordot(shares[likely] / shares[likely].sum(), pieces, 1))


def _rising(count: int, shared: bool) -> Floats:
    """Weight of the help: 0 at the first of `count` frames, 1 at the last.

    On a node between two jumps, one weight rises while the other falls, and they sum to 1.
    """
    return np.linspace(0.0, 1.0, count) if count > 1 else np.full(count, 0.5 if shared else 1.0)


def _ends_apart(pair: tuple[Floats, Floats], left: Piece, right: Piece) -> float:
    """Distance of a help pair's outer end points from the pieces' own."""
    return float(np.linalg.norm(pair[0][:1] - left.motion[:1]) + np.linalg.norm(pair[1][-1:] - right.motion[-1:]))


def _fade(start: int, p: int, stop: int, q: int) -> Floats:
    """[p + q] 0 up to frame `start`, 1 from frame `p + stop`, linear between."""
    return np.clip((np.arange(p + q) - start + 0.5) / max(p + stop - start, 1), 0.0, 1.0)


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
