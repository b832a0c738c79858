"""What is heard has its say in the target cost: how nodes sounded, and how near they are to the pose that is expected."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..efase.nodes import Floats, Ints, Nodes
from ..expectation import Bands, Expectation, standardised
from ..folder import Folder
from ..products import product


@dataclass(frozen=True, eq=False)
class Heard:
    """Of one input."""

    costs: Floats
    """[P, N] of every node at every phone."""
    poses: Floats | None
    """[T, D] expected pose of each frame; None where nothing predicts it."""


class Hearing:
    """Both terms, as far as the model has them."""

    def __init__(self, folder: Folder, arrays: Mapping[str, NDArray[Any]], nodes: Nodes, threads: int) -> None:
        settings = folder.settings
        self.nodes, self.settings = nodes, settings
        self.bands = Bands(folder, threads)
        self.sounds = PhoneSounds(arrays, settings) if settings["sound_weight"] > 0 else None
        self.expectation = Expectation(folder, arrays, threads) if settings["pose_weight"] > 0 else None
        self.distances = PoseDistances(nodes, arrays["pose_metric"]) if self.expectation else None

    def hear(self, speech: Any, said: Sequence[int], felt: Sequence[int], spoken: NDArray[np.bool_], bounds: Ints) -> Heard:
        """said and felt [P] numbers of phones and emotions, spoken [P], bounds [P + 1] first frames."""
        ends_s = np.asarray(speech.phones.ends_s, np.float64)
        bands, fps = self.bands.of(speech), float(self.settings["database_fps"])
        costs, poses = np.zeros((len(said), len(self.nodes))), None
        if self.sounds is not None:
            costs[spoken] += self.settings["sound_weight"] * self.sounds.distances(bands, ends_s)[spoken]
        if self.expectation is not None and self.distances is not None:
            poses = self.expectation.poses(bands, said, ends_s, felt, fps, int(bounds[-1]))
            asked = np.flatnonzero(spoken & (np.diff(bounds) > 0))
            pieces = [poses[bounds[t] : bounds[t + 1]] for t in asked]
            costs[asked] += self.settings["pose_weight"] * self.distances.of(pieces)
        return Heard(costs, poses)


class PhoneSounds:
    """How the database's phones sounded."""

    def __init__(self, arrays: Mapping[str, NDArray[Any]], settings: Mapping[str, Any]) -> None:
        self.nodes = arrays["sound_nodes"].astype(np.float64)
        self.settings, self.arrays = settings, arrays

    def distances(self, bands: NDArray[np.float32], ends_s: Floats) -> Floats:
        """[P, N] squared distance of how each phone sounds to how each node did."""
        starts, a = np.concatenate([[0.0], ends_s[:-1]]), self.arrays
        first, last = self.settings["sound_span"]
        places = np.linspace(first, last, self.settings["sound_places"])
        times_s = starts[:, None] + places * (ends_s - starts)[:, None]
        spans = standardised(bands, times_s, a["sound_mean"], a["sound_deviation"]).reshape(len(ends_s), -1)
        sounds = (((spans - a["sound_centre"]) @ a["sound_basis"]) / a["sound_size"]).astype(np.float64)
        squared = np.square(sounds).sum(axis=1)[:, None] + np.square(self.nodes).sum(axis=1)
        return np.maximum(squared - 2 * product(sounds, self.nodes.T), 0.0)


# A node of l frames x, stretched to the L frames of a phone, is W x with W [L, l] of two neighbouring entries a row. The mean
# over frames of |W x - p|² is (x' W'W x - 2 x' W'p + p'p) / L, where W'W has three diagonals: what is quadratic in x needs
# only x_k·x_k and x_k·x_k+1, which do not depend on the input, and the rest is one matrix product for all phones at once.
class PoseDistances:
    """Weighted squared distance of all nodes to expected poses."""

    def __init__(self, nodes: Nodes, metric: NDArray[np.float32]) -> None:
        self.nodes, self.metric = nodes, metric.astype(np.float64)
        weighted = nodes.frames * metric.astype(np.float32)
        self._own = np.einsum("fd,fd->f", weighted, nodes.frames, dtype=np.float64)
        self._next = np.zeros(len(nodes.frames))
        self._next[:-1] = np.einsum("fd,fd->f", weighted[:-1], nodes.frames[1:], dtype=np.float64)
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
