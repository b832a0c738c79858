"""Which nodes may express a phone, what becomes of the emotion they lack, and what the search needs to know of them."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats, Ints
from ..warp import stretched
from .audio_cost import audio_costs
from .graph import Graph
from .search import Step

AS_RECORDED = -1
"""In place of the number of a map: the node's motion stays as it is."""

PHONE_LEVELS = ("phone", "viseme", "any phone")
EMOTION_LEVELS = ("emotion", "mapped", "any emotion")


@dataclass(frozen=True, eq=False)
class Maps:
    """Emotion maps: components of a motion in one emotion to those in another (Cao 2005, §5)."""

    pairs: Sequence[tuple[int, int]] = ()
    """M of (from, to), numbers of emotions."""
    apply: Callable[[Floats, int], Floats] = lambda components, _: components
    """Components [n, D] and the number of a map to components [n, D]."""

    def through(self, components: Floats, number: int) -> Floats:
        """[n, D] components through a map; a number below 0 is no map."""
        return self.apply(components, number) if number >= 0 and len(components) else components


@dataclass(frozen=True, eq=False)
class Candidates:
    """The nodes that may express one phone of the input."""

    nodes: Ints
    """[n]"""
    maps: Ints
    """[n] number of the emotion map that each one's motion goes through, or -1."""
    phone_level: str
    """Whether they are of the phone, of its viseme class, or of any phone."""
    emotion_level: str
    """Whether they have the emotion, are mapped to it, or have any."""

    def by_map(self) -> Iterator[tuple[int, Ints]]:
        """Each map that some of them go through, and which of them."""
        for number in np.unique(self.maps[self.maps != AS_RECORDED]).tolist():
            yield number, np.flatnonzero(self.maps == number)


class Chooser:
    """Candidates by phone and emotion, remembered."""

    def __init__(self, graph: Graph, maps: Maps) -> None:
        self.graph, self.maps = graph, maps
        self._known: dict[tuple[int, int], Candidates] = {}
        self._ends: dict[int, tuple[Candidates, Floats, Floats, Floats]] = {}

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

    def by_emotion(self, nodes: Ints, emotion: int) -> Iterator[tuple[str, Ints, Ints]]:
        """The levels of emotion at which some of these nodes can be had, best first: level, nodes, their maps."""
        feelings = self.graph.emotions[nodes]
        native = nodes[feelings == emotion]
        if len(native):
            yield EMOTION_LEVELS[0], native, np.full(len(native), AS_RECORDED)
        map_of = {source: number for number, (source, target) in enumerate(self.maps.pairs) if target == emotion}
        reached = np.isin(feelings, list(map_of))
        if reached.any():
            yield EMOTION_LEVELS[1], nodes[reached], np.array([map_of[int(e)] for e in feelings[reached]])
        if len(nodes):
            yield EMOTION_LEVELS[2], nodes, np.full(len(nodes), AS_RECORDED)

    def ends(self, candidates: Candidates, metric: Floats) -> tuple[Floats, Floats]:
        """[n, D] first and last frames of candidates, through their maps, times metric.

        They are the same wherever a phone comes again, and kept once: of each phone of a long input they would be gigabytes.
        """
        known = self._ends.get(id(candidates))
        if known is None or known[0] is not candidates or known[1] is not metric:
            graph, nodes = self.graph, candidates.nodes
            first, last = graph.frames[graph.starts[nodes]], graph.frames[graph.stops[nodes] - 1]
            for number, which in candidates.by_map():
                first[which] = self.maps.through(first[which], number)
                last[which] = self.maps.through(last[which], number)
            known = self._ends[id(candidates)] = candidates, metric, first @ metric, last @ metric
        return known[2:]

    def motion(self, node: int, number: int) -> Floats:
        """[L, D] a node's motion, through its map."""
        return self.maps.through(self.graph.motion(node), number)

    def sound_costs(self, wanted: Floats, nodes: Ints) -> Floats:
        """[n] how differently nodes sound from wanted [m, P] (eq. 5)."""
        graph = self.graph
        return audio_costs(wanted, graph.features, graph.feature_starts[nodes], graph.feature_stops[nodes])


def make_step(
    chooser: Chooser,
    candidates: Candidates,
    before: Candidates | None,
    wanted: Floats,
    metric: Floats,
    expected: Floats | None = None,
) -> Step:
    """What the search needs to know of candidates: audio cost against wanted [m, P], end frames, captured links.

    expected: [frames, D] the pose that the sound leads one to expect, as components times metric.
    """
    audio = chooser.sound_costs(wanted, candidates.nodes)
    pose = None if expected is None else pose_costs(chooser, candidates, expected, metric)
    return Step(audio, *chooser.ends(candidates, metric), _links(chooser.graph, candidates, before), pose)


def pose_costs(chooser: Chooser, candidates: Candidates, expected: Floats, metric: Floats) -> Floats:
    """[n] mean over the frames of ‖candidate - expected‖², each candidate stretched evenly to them; see `make_step`."""
    if not len(expected):
        return np.zeros(len(candidates.nodes))
    apart = stretched_motions(chooser, candidates, len(expected)) @ metric - expected
    return np.einsum("nkd,nkd->n", apart, apart) / len(expected)


def stretched_motions(chooser: Chooser, candidates: Candidates, count: int) -> Floats:
    """[n, count, D] the motion of every candidate, through its map, stretched evenly to `count` frames."""
    motions = stretched(chooser.graph, candidates.nodes, count)
    for number, which in candidates.by_map():
        flat = motions[which].reshape(-1, motions.shape[2])
        motions[which] = chooser.maps.through(flat, number).reshape(-1, count, motions.shape[2])
    return motions


def _links(graph: Graph, candidates: Candidates, before: Candidates | None) -> Ints:
    """Where each candidate's recorded predecessor stands among those before; both must go through the same map."""
    if before is None:
        return np.full(len(candidates.nodes), -1, np.int64)
    place = np.full(len(graph) + 1, -1, np.int64)
    place[before.nodes] = np.arange(len(before.nodes))
    link = place[graph.before[candidates.nodes]]
    same_map = before.maps[link] == candidates.maps
    return np.where((link >= 0) & same_map, link, -1)
