"""The map of one phone: where each frame of its nodes lies, which nodes fit where one is wanted, and new ones drawn into it.

A node is a directed curve on the map of its phone. For a phone that is to be said (Deng & Neumann 2008, §6.1), the frame at
the same relative time within each node is *time-correct*, and nodes between the same neighbours are *context-correct*.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, Self, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from facesynth.inference.arrays import Floats, Ints
from facesynth.inference.errors import FacesynthError, unknown
from facesynth.inference.filters import without_roughness
from facesynth.motion.maps.isomap import NEIGHBOURS, Isomap
from facesynth.motion.maps.plane import Mixed, Plane

Kind = Literal["isomap", "pca"]
KINDS: tuple[Kind, ...] = get_args(Kind)
LONGEST_S = 10.0
"""Of a node that is drawn; no phone is so long."""
FEWEST = 4 * NEIGHBOURS
"""Frames from which on a cluster has a shape to unroll."""
COLOURS = {
    "neutral": (0.75, 0.75, 0.75),
    "angry": (0.90, 0.16, 0.12),
    "sad": (0.10, 0.62, 0.22),
    "happy": (0.16, 0.36, 0.95),
}
"""Of the paper; its neutral is black, which on a dark picture cannot be seen."""
OTHER_COLOURS = ((0.90, 0.60, 0.0), (0.80, 0.47, 0.65), (0.34, 0.71, 0.91), (0.94, 0.89, 0.26))
"""Of further emotions, in the order of the corpus (Okabe & Ito)."""


def emotion_colours(emotions: Sequence[str]) -> dict[str, tuple[float, float, float]]:
    """Red, green and blue 0..1 of each emotion."""
    others = [emotion for emotion in emotions if emotion not in COLOURS]
    return {e: COLOURS[e] if e in COLOURS else OTHER_COLOURS[others.index(e) % len(OTHER_COLOURS)] for e in emotions}


@dataclass(frozen=True, eq=False)
class Cluster:
    """All frames of one phone's nodes, K nodes of n frames."""

    phone: str
    names: tuple[str, ...]
    """K nodes, `utterance:phone_number`."""
    emotions: tuple[str, ...]
    """K, of each node."""
    contexts: tuple[tuple[str, str], ...]
    """K phones before and after each node; `pau` where none was recorded there."""
    lengths: Ints
    """[K] frames of each node."""
    frames: Floats
    """[n, D] coordinates, one node after the other."""
    fps: float
    """Of the frames, Hz."""
    decode: Callable[[NDArray[np.float32]], NDArray[np.float32]]
    """Coordinates [T, D] to frames [T, C] of the layout."""

    @cached_property
    def starts(self) -> Ints:
        """[K] first frame of each node."""
        return np.concatenate([[0], np.cumsum(self.lengths)[:-1]]).astype(np.int64)

    @cached_property
    def node(self) -> Ints:
        """[n] place of the node that each frame belongs to."""
        return np.repeat(np.arange(len(self.names)), self.lengths)

    @cached_property
    def progress(self) -> Floats:
        """[n] relative time of each frame within its node, 0..1."""
        within = np.arange(len(self.frames)) - np.repeat(self.starts, self.lengths)
        return within / np.repeat(np.maximum(self.lengths - 1, 1), self.lengths)

    def place(self, name: str) -> int:
        """Of a node among the names."""
        if name not in self.names:
            raise unknown(f"node of {self.phone}", name, self.names)
        return self.names.index(name)


@dataclass(frozen=True, eq=False)
class Drawn:
    """A new node, drawn on the map."""

    frames: NDArray[np.float32]
    """[L, C] in the layout's unit, at the cluster's rate."""
    curve: Floats
    """[L, 2] where its frames lie on the map."""
    outside: int
    """So many of them lay outside of all triangles; the nearest recorded frame was taken."""


@dataclass(frozen=True, eq=False)
class PhoneMap:
    """A cluster on a plane."""

    cluster: Cluster
    kind: Kind
    plane: Plane

    @classmethod
    def of(cls, cluster: Cluster, kind: Kind = "isomap", points: ArrayLike | None = None) -> Self:
        """Embed a cluster; points [n, 2] are those of an earlier embedding, where one was kept.

        A cluster of too few frames for neighbours has its principal components on a map of either kind.
        """
        if kind not in KINDS:
            raise unknown("kind of map", kind, KINDS)
        if points is not None and np.shape(points) != (len(cluster.frames), 2):
            raise FacesynthError(f"{len(cluster.frames)} frames of {cluster.phone} have places of shape {np.shape(points)}")
        new = cls(cluster, kind, Plane(np.zeros((0, 2))))
        return replace(new, plane=Plane(new.placed(cluster.frames) if points is None else np.asarray(points, np.float64)))

    @cached_property
    def _isomap(self) -> Isomap:
        return Isomap.fit(self.cluster.frames)

    def placed(self, frames: ArrayLike) -> Floats:
        """[m, 2] where frames [m, D], coordinates of this model, lie on this map; they need not be of the cluster."""
        if self.kind == "isomap" and len(self.cluster.frames) > FEWEST:
            return self._isomap.place(frames)
        mean, axes = _axes(self.cluster.frames)
        return (np.asarray(frames, np.float64) - mean) @ axes

    def curve(self, name: str) -> Floats:
        """[L, 2] of a node, in the order in which its frames were recorded."""
        k = self.cluster.place(name)
        first = self.cluster.starts[k]
        return self.plane.points[first : first + self.cluster.lengths[k]]

    def picked(self, places: ArrayLike) -> tuple[NDArray[np.float32], Mixed]:
        """[m, C] frames at places [m, 2], and what they are made of: `inside` says where there is none but the nearest."""
        mixed = self.plane.mixed(places)
        return self.cluster.decode(mixed.of(self.cluster.frames).astype(np.float32)), mixed

    def shown(self, emotions: Collection[str] | None = None, utterances: Collection[str] | None = None) -> NDArray[np.bool_]:
        """[K] which nodes a filter leaves; None lets all pass."""
        return np.array(
            [
                (emotions is None or emotion in emotions) and (utterances is None or name.rpartition(":")[0] in utterances)
                for name, emotion in zip(self.cluster.names, self.cluster.emotions, strict=True)
            ],
            bool,
        )

    def time_correct(self, progress: float) -> Floats:
        """[K, 2] where each node is at a relative time 0..1, between its frames."""
        if not 0 <= progress <= 1:
            raise FacesynthError(f"a relative time lies from 0 to 1; got {progress:g}")
        at = progress * (self.cluster.lengths - 1)
        low = np.minimum(at.astype(np.int64), np.maximum(self.cluster.lengths - 2, 0))
        high = np.minimum(low + 1, self.cluster.lengths - 1)
        share, points = (at - low)[:, None], self.plane.points
        return (1 - share) * points[self.cluster.starts + low] + share * points[self.cluster.starts + high]

    def context_correct(self, before: str, after: str) -> NDArray[np.bool_]:
        """[K] which nodes stood between these phones."""
        return np.array([context == (before, after) for context in self.cluster.contexts], bool)

    def picture(self, size: tuple[int, int], shown: NDArray[np.bool_] | None = None, **brightness: float) -> NDArray[np.float32]:
        """See `Plane.picture`; the nodes that a filter leaves, in the colours of their emotions."""
        colours = emotion_colours(sorted(set(self.cluster.emotions)))
        light = np.array([colours[emotion] for emotion in self.cluster.emotions])
        if shown is not None:
            light = light * shown[:, None]
        return self.plane.picture(light[self.cluster.node], size, **brightness)

    def drawn(self, path: ArrayLike, duration_s: float) -> Drawn:
        """A node along a path [m, 2] that somebody drew, at even speed.

        Frames that lie beside each other on the map may differ in what it does not show: what is quicker than a face is
        smoothed away.
        """
        corners = np.asarray(path, np.float64)
        if corners.ndim != 2 or corners.shape[1:] != (2,) or len(corners) < 2 or not np.isfinite(corners).all():
            raise FacesynthError(f"a path is drawn through at least 2 places [m, 2]; got shape {corners.shape}")
        fps = self.cluster.fps
        count = round(duration_s * fps) if np.isfinite(duration_s) else 0
        if not 1 <= count <= LONGEST_S * fps:
            raise FacesynthError(f"a drawn node lasts from {1 / fps:.3f} s (one frame) to {LONGEST_S:g} s; got {duration_s:g} s")
        walked = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
        at = np.linspace(0, walked[-1], count)
        curve = np.stack([np.interp(at, walked, column) for column in corners.T], axis=1)
        mixed = self.plane.mixed(curve)
        smooth = without_roughness(mixed.of(self.cluster.frames), self.cluster.fps)
        return Drawn(self.cluster.decode(smooth.astype(np.float32)), curve, int((~mixed.inside).sum()))


def _axes(frames: Floats) -> tuple[Floats, Floats]:
    """Mean and the two directions of most variance, each with its largest entry positive."""
    mean = frames.mean(axis=0)
    _, directions = np.linalg.eigh((frames - mean).T @ (frames - mean))
    two = directions[:, ::-1][:, :2]
    two = two * np.where(two[np.abs(two).argmax(axis=0), np.arange(two.shape[1])] < 0, -1.0, 1.0)
    return mean, np.pad(two, ((0, 0), (0, 2 - two.shape[1])))
