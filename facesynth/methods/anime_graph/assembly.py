"""From chosen nodes to one continuous motion: time-warp and blending (Cao 2005, §4.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.warp import time_warp
from facesynth.methods.anime_graph.audio_cost import audio_costs, warp_path
from facesynth.methods.anime_graph.candidates import Chooser

VELOCITY_LASTS_S = 0.04
"""Time constant with which an extrapolated movement comes to rest."""
WARP_SMOOTHING = 2.0
"""Standard deviation, in feature frames, of the smoothing of a time-warp."""

Frames = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Piece:
    """One phone of the output: the node that expresses it, brought to the phone's frames."""

    phone: int
    """Index of the input's phone."""
    emotion: int
    """Index of the input's emotion."""
    node: int
    map: int
    """Number of the emotion map that its motion went through, or -1."""
    wanted: Frames
    """[m, P] the input's audio features."""
    motion: Frames
    """[n, D] time-warped motion."""


@dataclass(frozen=True, eq=False)
class Join:
    """How a jump is bridged: what is added to the unblended motion of the pieces on both sides."""

    how: str
    """`help` or `extension`."""
    left: Frames
    """[n, D]"""
    right: Frames
    """[n', D]"""


def warped(motion: Frames, wanted: Frames, heard: Frames, count: int) -> Frames:
    """Motion [L, D] of a node that sounded like heard [L', P], brought to `count` frames of speech like wanted [m, P].

    DTW of the audio says which moment of the node belongs to which moment of the input. The ends are held, and the
    departure from even timing is smoothed; smoothing of a monotone path, continued oddly at its ends, is monotone.
    """
    if count == 0:
        return motion[:0]
    if count == 1 or len(wanted) < 2 or len(heard) < 2:
        return time_warp(motion, count)
    even = np.linspace(0, 1, len(wanted))
    path = warp_path(wanted, heard) / (len(heard) - 1)
    path[0], path[-1] = 0.0, 1.0
    place = np.interp(np.linspace(0, 1, count), even, even + _smooth_between_zeros(path - even)) * (len(motion) - 1)
    low = np.clip(place.astype(np.int64), 0, max(len(motion) - 2, 0))
    share = (place - low)[:, None]
    return (1 - share) * motion[low] + share * motion[np.minimum(low + 1, len(motion) - 1)]


def _smooth_between_zeros(departure: Frames) -> Frames:
    from scipy.ndimage import gaussian_filter1d

    margin = min(len(departure) - 1, round(4 * WARP_SMOOTHING))
    padded = np.pad(departure, margin, mode="reflect", reflect_type="odd")
    smooth = gaussian_filter1d(padded, WARP_SMOOTHING)[margin : margin + len(departure)]
    smooth[0] = smooth[-1] = 0.0
    return smooth


def bridge(chooser: Chooser, left: Piece, right: Piece, fps: float, *, left_shared: bool, right_shared: bool) -> Join:
    """The join of two pieces that were not recorded one after the other.

    `left_shared` and `right_shared` tell whether the piece also ends in a jump on its other side; a fade between
    extensions then keeps to the half of it that is nearer.
    """
    helped = _help(chooser, left, right)
    if helped is None:
        return _extend(chooser, left, right, fps, left_shared=left_shared, right_shared=right_shared)
    rise, fall = _rising(len(left.motion), left_shared), _rising(len(right.motion), right_shared)[::-1]
    return Join("help", rise[:, None] * (helped[0] - left.motion), fall[:, None] * (helped[1] - right.motion))


def _rising(count: int, shared: bool) -> Frames:
    """Weight of the help: 0 at the first of `count` frames, 1 at the last.

    On a node between two jumps, one weight rises while the other falls, and they sum to 1.
    """
    return np.linspace(0.0, 1.0, count) if count > 1 else np.full(count, 0.5 if shared else 1.0)


def _help(chooser: Chooser, left: Piece, right: Piece) -> tuple[Frames, Frames] | None:
    """The recorded transition between these phones, warped to both pieces' timing, if the graph has one.

    Among several in the best available emotion: the least audio cost, then the nearest end points.
    """
    graph = chooser.graph
    if not chooser.help_pairs:
        return None
    nodes = np.flatnonzero((graph.phones == graph.phones[left.node]) & (graph.after >= 0))
    nodes = nodes[graph.phones[graph.after[nodes]] == graph.phones[right.node]]
    if not len(nodes):
        return None
    _, nodes, maps = next(chooser.by_emotion(nodes, left.emotion))
    cost = _audio(chooser, left, nodes) + _audio(chooser, right, graph.after[nodes])
    tied = np.flatnonzero(cost <= cost.min() + 1e-9)
    warps = [_help_pair(chooser, left, right, int(nodes[k]), int(maps[k])) for k in tied]
    return min(warps, key=lambda pair: _ends_apart(pair, left, right))


def _help_pair(chooser: Chooser, left: Piece, right: Piece, node: int, number: int) -> tuple[Frames, Frames]:
    follower = int(chooser.graph.after[node])
    m, n = (
        warped(chooser.motion(of, number), piece.wanted, chooser.graph.audio(of), len(piece.motion))
        for piece, of in ((left, node), (right, follower))
    )
    return m, n


def _ends_apart(pair: tuple[Frames, Frames], left: Piece, right: Piece) -> float:
    """Distance of a help pair's outer end points from the pieces' own."""
    return float(np.linalg.norm(pair[0][:1] - left.motion[:1]) + np.linalg.norm(pair[1][-1:] - right.motion[-1:]))


def _audio(chooser: Chooser, piece: Piece, nodes: NDArray[np.int64]) -> Frames:
    graph = chooser.graph
    return audio_costs(piece.wanted, graph.features, graph.feature_starts[nodes], graph.feature_stops[nodes])


def _extend(chooser: Chooser, left: Piece, right: Piece, fps: float, *, left_shared: bool, right_shared: bool) -> Join:
    """Cross-fade of the left node continued and the right node begun earlier, linear over both pieces.

    As many frames as the other piece has are taken from the recording; where it ends, the movement runs out.
    """
    p, q = len(left.motion), len(right.motion)
    onward = _prolonged(left.motion, chooser.maps.apply_array(chooser.graph.following(left.node, q), left.map), q, fps)
    earlier = chooser.maps.apply_array(chooser.graph.preceding(right.node, p), right.map)
    backward = _prolonged(right.motion[::-1], earlier[::-1], p, fps)[::-1]
    rise = _fade(p // 2 if left_shared else 0, p, q // 2 if right_shared else q, q)
    return Join("extension", rise[:p, None] * (backward - left.motion), (1 - rise[p:, None]) * (onward - right.motion))


def _fade(start: int, p: int, stop: int, q: int) -> Frames:
    """[p + q] 0 up to frame `start`, 1 from frame `p + stop`, linear between."""
    return np.clip((np.arange(p + q) - start + 0.5) / max(p + stop - start, 1), 0.0, 1.0)


def _prolonged(motion: Frames, recorded: Frames, count: int, fps: float) -> Frames:
    """`count` frames after motion [n, D]: the recorded ones, then the last velocity, running out."""
    known = np.concatenate([motion[-2:], recorded])
    missing = count - len(recorded)
    if missing <= 0 or not len(known):
        return recorded[:count] if len(known) else np.zeros((count, motion.shape[1]))
    velocity = known[-1] - known[-2] if len(known) > 1 else np.zeros(motion.shape[1])
    lasting = VELOCITY_LASTS_S * fps
    travelled = lasting * (1 - np.exp(-np.arange(1, missing + 1) / lasting))
    return np.concatenate([recorded, known[-1] + travelled[:, None] * velocity])


class Blender:
    """Pieces in, blended pieces out; a piece is final when the next two are known."""

    def __init__(self, chooser: Chooser, fps: float) -> None:
        self.chooser, self.fps = chooser, fps
        self.pieces: list[Piece] = []
        self.jumps: list[bool] = []
        """For each piece whether it was jumped to."""
        self.joins: dict[int, Join] = {}
        """By the piece on the right."""

    def add(self, piece: Piece, captured: bool) -> None:
        """The next piece; `captured`: it was recorded right after the one before."""
        self.jumps.append(bool(self.pieces) and not captured)
        self.pieces.append(piece)

    def blended(self, t: int) -> Frames:
        """[n, D] piece t with the joins on both of its sides; those that are not known yet count as captured."""
        motion = self.pieces[t].motion
        if self._jumped(t):
            motion = motion + self._join(t).right
        if self._jumped(t + 1):
            motion = motion + self._join(t + 1).left
        return motion

    def _jumped(self, t: int) -> bool:
        return 0 <= t < len(self.jumps) and self.jumps[t]

    def _join(self, t: int) -> Join:
        if t not in self.joins:
            self.joins[t] = bridge(
                self.chooser,
                self.pieces[t - 1],
                self.pieces[t],
                self.fps,
                left_shared=self._jumped(t - 1),
                right_shared=self._jumped(t + 1),
            )
        return self.joins[t]
