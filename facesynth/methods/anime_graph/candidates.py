"""Which nodes may express a phone, and what becomes of the emotion they lack."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.warp import stretched
from facesynth.methods.anime_graph.audio_cost import audio_costs
from facesynth.methods.anime_graph.graph import Graph
from facesynth.methods.anime_graph.maps import EmotionMaps
from facesynth.methods.anime_graph.search import Step

AS_RECORDED = -1
"""In place of the number of a map: the node's motion stays as it is."""

PHONE_LEVELS = ("phone", "viseme", "any phone")
EMOTION_LEVELS = ("emotion", "mapped", "any emotion")


@dataclass(frozen=True, eq=False)
class Candidates:
    """The nodes that may express one phone of the input."""

    nodes: NDArray[np.int64]
    """[n]"""
    maps: NDArray[np.int64]
    """[n] number of the emotion map that each one's motion goes through, or -1."""
    phone_level: str
    """Whether they are of the phone, of its viseme class, or of any phone."""
    emotion_level: str
    """Whether they have the emotion, are mapped to it, or have any."""


class Chooser:
    """Candidates by phone and emotion, remembered."""

    def __init__(self, graph: Graph, maps: EmotionMaps, *, help_pairs: bool = True) -> None:
        self.graph, self.maps, self.help_pairs = graph, maps, help_pairs
        self._known: dict[tuple[int, int], Candidates] = {}

    def candidates(self, phone: int, emotion: int) -> Candidates:
        """Nodes of the phone, else of its viseme class, else any; with the emotion, else mapped, else of any."""
        if (phone, emotion) not in self._known:
            self._known[phone, emotion] = self._find(phone, emotion)
        return self._known[phone, emotion]

    def _find(self, phone: int, emotion: int) -> Candidates:
        nodes_by_level = (self.graph.of_phone(phone), self.graph.of_viseme(phone), np.arange(len(self.graph)))
        level, nodes = next((name, n) for name, n in zip(PHONE_LEVELS, nodes_by_level, strict=True) if len(n))
        emotion_level, chosen, maps = next(self.by_emotion(nodes, emotion))
        return Candidates(chosen, maps, level, emotion_level)

    def by_emotion(self, nodes: NDArray[np.int64], emotion: int) -> Iterator[tuple[str, NDArray[np.int64], NDArray[np.int64]]]:
        """The levels of emotion at which some of these nodes can be had, best first: level, nodes, their maps."""
        feelings = self.graph.emotions[nodes]
        native = nodes[feelings == emotion]
        if len(native):
            yield EMOTION_LEVELS[0], native, np.full(len(native), AS_RECORDED)
        map_of = {source: self.maps.find(source, emotion) for source in self.maps.sources_of(emotion)}
        mapped = nodes[np.isin(feelings, list(map_of))]
        if len(mapped):
            yield EMOTION_LEVELS[1], mapped, self._map_numbers(mapped, map_of)
        if len(nodes):
            yield EMOTION_LEVELS[2], nodes, np.full(len(nodes), AS_RECORDED)

    def _map_numbers(self, nodes: NDArray[np.int64], map_of: Mapping[int, int | None]) -> NDArray[np.int64]:
        return np.array([map_of[int(e)] for e in self.graph.emotions[nodes]], np.int64)

    def motion(self, node: int, number: int) -> NDArray[np.float64]:
        """[L, D] a node's motion, through its map."""
        return self.maps.apply_array(self.graph.motion(node), number)


def make_step(
    chooser: Chooser,
    candidates: Candidates,
    before: Candidates | None,
    wanted: NDArray[np.float64],
    metric: NDArray[np.float64],
    expected: NDArray[np.float64] | None = None,
) -> Step:
    """What the search needs to know of candidates: audio cost against wanted [m, P], end frames, captured links.

    expected: [frames, D] the pose that the sound leads one to expect, as components times metric.
    """
    graph, nodes = chooser.graph, candidates.nodes
    first, last = graph.frames[graph.starts[nodes]], graph.frames[graph.stops[nodes] - 1]
    for number in np.unique(candidates.maps[candidates.maps != AS_RECORDED]):
        through = candidates.maps == number
        first[through] = chooser.maps.apply_array(first[through], int(number))
        last[through] = chooser.maps.apply_array(last[through], int(number))
    audio = audio_costs(wanted, graph.features, graph.feature_starts[nodes], graph.feature_stops[nodes])
    pose = None if expected is None else pose_costs(chooser, candidates, expected, metric)
    return Step(audio, first @ metric, last @ metric, _links(graph, candidates, before), pose)


def pose_costs(
    chooser: Chooser, candidates: Candidates, expected: NDArray[np.float64], metric: NDArray[np.float64]
) -> NDArray[np.float64]:
    """[n] mean over the frames of ‖candidate - expected‖², each candidate stretched evenly to them; see `make_step`."""
    if not len(expected):
        return np.zeros(len(candidates.nodes))
    return ((stretched_motions(chooser, candidates, len(expected)) @ metric - expected) ** 2).sum(axis=2).mean(axis=1)


def stretched_motions(chooser: Chooser, candidates: Candidates, count: int) -> NDArray[np.float64]:
    """[n, count, D] the motion of every candidate, through its map, stretched evenly to `count` frames."""
    motions = stretched(chooser.graph, candidates.nodes, count)
    for number in np.unique(candidates.maps[candidates.maps != AS_RECORDED]):
        through = candidates.maps == number
        flat = motions[through].reshape(-1, motions.shape[2])
        motions[through] = chooser.maps.apply_array(flat, int(number)).reshape(-1, count, motions.shape[2])
    return motions


def _links(graph: Graph, candidates: Candidates, before: Candidates | None) -> NDArray[np.int64]:
    """Where each candidate's recorded predecessor stands among those before; both must go through the same map."""
    if before is None:
        return np.full(len(candidates.nodes), -1, np.int64)
    place = np.full(len(graph) + 1, -1, np.int64)
    place[before.nodes] = np.arange(len(before.nodes))
    link = place[graph.before[candidates.nodes]]
    same_map = before.maps[link] == candidates.maps
    return np.where((link >= 0) & same_map, link, -1)
