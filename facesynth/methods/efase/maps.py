"""The nodes of a database as clusters, one for each phone, to be put on maps."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.arrays import Ints
from facesynth.inference.efase.nodes import Nodes
from facesynth.inference.errors import unknown
from facesynth.inference.phones import PHONES, SILENCE
from facesynth.motion.maps.phone_map import Cluster, PhoneMap
from facesynth.progress import track

Decode = Callable[[NDArray[np.float32]], NDArray[np.float32]]


def mapped_phones(nodes: Nodes) -> tuple[str, ...]:
    """Phones that have nodes, in the order of the alphabet of phones."""
    return tuple(PHONES[k] for k in np.unique(nodes.phones))


def cluster_of(nodes: Nodes, names: Sequence[str], emotions: Sequence[str], fps: float, decode: Decode, phone: str) -> Cluster:
    """All nodes of one phone, in the order of the database."""
    if phone not in mapped_phones(nodes):
        raise unknown("phone with nodes", phone, mapped_phones(nodes))
    which = np.flatnonzero(nodes.phones == PHONES.index(phone))
    return Cluster(
        phone,
        tuple(names[k] for k in which.tolist()),
        tuple(emotions[k] for k in nodes.emotions[which].tolist()),
        tuple(zip(_labels(nodes, nodes.before[which]), _labels(nodes, nodes.after[which]), strict=True)),
        nodes.lengths[which],
        nodes.frames[frames_of(nodes, which)].astype(np.float64),
        fps,
        decode,
    )


def frames_of(nodes: Nodes, which: Ints) -> Ints:
    """[n] the frames of some nodes, one node after the other."""
    return np.concatenate([np.arange(nodes.starts[k], nodes.stops[k]) for k in which])


def map_beside(cluster: Cluster, frames: Ints, places: NDArray[np.float32]) -> PhoneMap:
    """The map of a cluster whose n frames stand at `frames` [n] of the database; those that came after `places` [F, 2] of all
    were made are placed among the others.
    """
    old = frames < len(places)
    if old.all():
        return PhoneMap.of(cluster, points=places[frames])
    if not old.any():
        return PhoneMap.of(cluster)
    first = PhoneMap.of(_recorded(cluster, old), points=places[frames[old]])
    points = np.empty((len(frames), 2))
    points[old], points[~old] = places[frames[old]], first.placed(cluster.frames[~old])
    return PhoneMap.of(cluster, points=points)


def _recorded(cluster: Cluster, old: NDArray[np.bool_]) -> Cluster:
    """The nodes of a cluster whose frames were there before."""
    which = np.flatnonzero(old[cluster.starts])
    return replace(
        cluster,
        names=tuple(cluster.names[k] for k in which.tolist()),
        emotions=tuple(cluster.emotions[k] for k in which.tolist()),
        contexts=tuple(cluster.contexts[k] for k in which.tolist()),
        lengths=cluster.lengths[which],
        frames=cluster.frames[old],
    )


def places_of_all(nodes: Nodes, names: Sequence[str], emotions: Sequence[str], fps: float, decode: Decode) -> NDArray[np.float32]:
    """[F, 2] where each frame of the database lies on the Isomap of its phone."""
    places = np.zeros((len(nodes.frames), 2), np.float32)
    for phone in track(mapped_phones(nodes), "maps"):
        which = np.flatnonzero(nodes.phones == PHONES.index(phone))
        found = PhoneMap.of(cluster_of(nodes, names, emotions, fps, decode, phone))
        places[frames_of(nodes, which)] = found.plane.points
    return places


def _labels(nodes: Nodes, which: Ints) -> Iterator[str]:
    return (PHONES[nodes.phones[k]] if k >= 0 else SILENCE for k in which)
