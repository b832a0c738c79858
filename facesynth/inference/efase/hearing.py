"""What is heard has its say in the target cost: how nodes sounded, and how near they are to the pose that is expected.

Two terms, both 0 in the paper:

* sound: squared distance between the sound of the input's phone and of the node's, log-mel bands at five times over
  the phone and a little around it, as principal components of unit variance;
* pose: mean over the phone's frames of ‖expected - node‖², the expected pose from `Expectation`, the node
  time-warped to the phone.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..efase.nodes import Nodes
from ..efase.steps import squared_distances
from ..expectation import Bands, Expectation, Said, Single, Standard
from ..long_arrays import let_go, zeros
from ..phones import PHONES, SILENCE
from ..products import product
from ..speech import PhoneTrack, Speech

SPAN = (-0.25, 1.25)
"""From where to where the sound of a phone is taken, in parts of its duration."""
PLACES = 5
TOGETHER_BYTES = 32 << 20
"""Costs of so many phones at all nodes that are computed together: 138 phones of 30,000 nodes."""


@dataclass(frozen=True, eq=False)
class Heard:
    """Of one input."""

    costs: Floats
    """[P, N] of every node at every phone; in a file where they are large, for a search looks at one stretch of them."""
    sounds: Floats | None
    """[P, A] sound of each phone; None where it does not count."""
    poses: Floats | None
    """[T, D] expected pose of each frame; None where nothing predicts it."""


@dataclass(frozen=True, eq=False)
class PhoneSounds:
    """How the database's phones sounded, as vectors whose squared distance is 2 on average between two nodes."""

    nodes: NDArray[np.floating]
    """[N, A] of every node."""
    centre: Single
    """[PLACES * B]"""
    basis: Single
    """[PLACES * B, A]"""
    size: Single
    """[A] what each component is divided by."""
    standard: Standard

    def of(self, bands: Single, phones: PhoneTrack) -> Floats:
        """[P, A] the sound of each phone of a speech with these bands [F, B]."""
        spans = phone_spans(bands, phones, self.standard)
        return (((spans - self.centre) @ self.basis) / self.size).astype(np.float64)

    def distances(self, sounds: Sequence[Floats]) -> Floats:
        """[P, N] squared distance of sounds [P, A] to those of the nodes."""
        return squared_distances(np.asarray(sounds).reshape(-1, self.nodes.shape[1]), self.nodes.astype(np.float64))


def phone_spans(bands: Single, phones: PhoneTrack, standard: Standard) -> Single:
    """[P, PLACES * B] standardised bands over each phone and a little around it."""
    places = np.linspace(*SPAN, PLACES)
    times_s = phones.starts_s[:, None] + places * (phones.ends_s - phones.starts_s)[:, None]
    return standard.at(bands, times_s).reshape(len(phones), -1)


# A node of l frames x, stretched to the L frames of a phone, is W x with W [L, l] of two neighbouring entries a row. The mean
# over frames of |W x - p|² is (x' W'W x - 2 x' W'p + p'p) / L, where W'W has three diagonals: what is quadratic in x needs
# only x_k·x_k and x_k·x_k+1, which do not depend on the input, and the rest is one matrix product for all phones at once.
class PoseDistances:
    """Weighted squared distance of all nodes to expected poses."""

    def __init__(self, nodes: Nodes, metric: NDArray[np.floating]) -> None:
        """metric [D]: how much a squared difference of each coordinate counts."""
        self.nodes, self.metric = nodes, metric.astype(np.float64)
        weighted = nodes.frames * self.metric
        self._own = np.einsum("fd,fd->f", weighted, nodes.frames)
        self._next = np.zeros(len(nodes.frames))
        self._next[:-1] = np.einsum("fd,fd->f", weighted[:-1], nodes.frames[1:])
        self._by_length = [np.flatnonzero(nodes.lengths == length) for length in np.unique(nodes.lengths)]

    def of(self, pieces: Sequence[Floats]) -> Floats:
        """[P, N] for P pieces [L, D] of expected poses: mean over frames of the squared distance."""
        out = np.empty((len(pieces), len(self.nodes)))
        constant = np.array([(np.square(piece) @ self.metric).mean() for piece in pieces])
        for which in self._by_length:
            length = int(self.nodes.lengths[which[0]])
            rows = self.nodes.starts[which][:, None] + np.arange(length)
            stretches = [stretching(length, len(piece)) for piece in pieces]
            own = np.stack([np.square(w).mean(axis=0) for w in stretches], axis=1)  # [l, P]
            following = np.stack([2 * (w[:, :-1] * w[:, 1:]).mean(axis=0) for w in stretches], axis=1)
            wanted = [2 * (w.T @ (piece * self.metric)).ravel() / len(piece) for w, piece in zip(stretches, pieces, strict=True)]
            squares = product(self._own[rows], own) + product(self._next[rows[:, :-1]], following)
            crossed = product(self.nodes.frames[rows].reshape(len(which), -1).astype(np.float64), np.stack(wanted, axis=1))
            out[:, which] = np.maximum(squares - crossed + constant, 0.0).T
        return out


def stretching(length: int, count: int) -> Floats:
    """[count, length] by which a motion of `length` frames is stretched to `count`; one frame of many is the middle."""
    share = np.array([0.5]) if count == 1 else np.linspace(0, 1, count)
    at = np.arange(count, dtype=np.float64) if count == length else (length - 1) * share
    low = np.minimum(at.astype(np.int64), max(length - 2, 0))
    matrix, rows = np.zeros((count, length)), np.arange(count)
    matrix[rows, np.minimum(low + 1, length - 1)] += at - low
    matrix[rows, low] += 1 - (at - low)
    return matrix


@dataclass(frozen=True, eq=False)
class Hearing:
    """Both terms, as far as a model has them."""

    bands: Bands
    sounds: PhoneSounds | None
    sound_weight: float
    expectation: Expectation | None
    distances: PoseDistances | None
    """There with the expectation."""
    pose_weight: float

    def hear(self, speech: Speech, felt: Ints, count: int, fps: float) -> Heard:
        """felt [P] numbers of the emotions, count nodes, fps of the database."""
        labels, bounds, bands = speech.phones.labels, speech.phones.frame_bounds(fps), self.heard_bands(speech)
        spoken = np.flatnonzero([label != SILENCE for label in labels])
        costs, sounds, poses = zeros((len(labels), count)), None, None
        if self.sounds is not None:
            sounds = self.sounds.of(bands, speech.phones)
            self._add(costs, spoken, self.sound_weight, "sound", self.sounds.distances, list(sounds[spoken]))
        if self.expectation is not None and self.distances is not None:
            said = Said.numbered(
                [PHONES.index(label) for label in labels],
                speech.phones.ends_s,
                felt.tolist(),
                self.expectation.reading.emotion_count,
            )
            poses = self.expectation.poses(bands, said, fps, int(bounds[-1]))
            asked = spoken[np.diff(bounds)[spoken] > 0]
            pieces = [poses[bounds[t] : bounds[t + 1]] for t in asked]
            self._add(costs, asked, self.pose_weight, "pose", self.distances.of, pieces)
        return Heard(costs, sounds, poses)

    def _add(
        self,
        costs: Floats,
        asked: Ints,
        weight: float,
        what: str,
        compute: Callable[[Sequence[Floats]], Floats],
        pieces: Sequence[Floats],
    ) -> None:
        """To the costs [P, N] of the phones `asked` [n], what is computed of their n pieces, some phones at a time."""
        together = max(1, TOGETHER_BYTES // max(1, costs[:1].nbytes))
        for first in range(0, len(asked), together):
            some = slice(first, first + together)
            costs[asked[some]] += weight * self.rows(what, compute, pieces[some])
            let_go(costs)

    def heard_bands(self, speech: Speech) -> Single:
        """[F, 40] log-mel bands of the sound."""
        return self.bands(speech)

    def rows(self, what: str, compute: Callable[[Sequence[Floats]], Floats], asked: Sequence[Floats]) -> Floats:
        """[P, N] costs of P phones at all nodes, of what is heard or expected of each; an heir may know some of them."""
        return compute(asked)
