"""The recorded nodes, which of them may express a phone, and the cheapest path (Cao 2005, §4.1 and §4.2)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..anime_graph.hearing import Floats, Ints, audio_costs
from ..errors import FacesynthError
from ..graphs import Graph as OnnxGraph
from ..posterior import posterior


@dataclass(frozen=True)
class Weights:
    """Of eq. 2."""

    jump: float
    jump_cost: float
    audio: float
    pose: float

    def target(self, step: Step) -> Floats:
        """[n] what each candidate costs, wherever one comes from."""
        cost = self.audio * step.audio
        return cost if step.pose is None else cost + self.pose * step.pose


@dataclass(frozen=True, eq=False)
class Wish:
    """What one phone of the input asks for."""

    phone: int
    emotion: int
    wanted: Floats
    """[m, P]"""
    frames: int
    expected: Floats | None = None
    """[frames, D] pose that the sound leads one to expect, as components times metric."""


@dataclass(frozen=True, eq=False)
class Candidates:
    """The nodes that may express one phone, each with the number of the emotion map that it goes through, or -1."""

    nodes: Ints
    maps: Ints


@dataclass(frozen=True, eq=False)
class Step:
    """What the search needs of the candidates for one phone."""

    audio: Floats
    """[n]"""
    last: Floats
    """[n, D] last frames, in coordinates whose distance is that of frames."""
    link: Ints
    """[n] the candidate before that was recorded just before, or -1."""
    jumps: Floats
    """[n, n before] cost of jumping there; infinite from the linked one."""
    pose: Floats | None = None
    """[n] mean squared distance from the expected pose."""


class Nodes:
    """N nodes as arrays, with their emotion maps."""

    def __init__(
        self, arrays: Mapping[str, NDArray[Any]], visemes: Sequence[int], pairs: Sequence[Sequence[int]], maps: OnnxGraph | None
    ) -> None:
        for name in ("frames", "features"):
            scale = arrays[f"{name}_scale"].astype(np.float64) if f"{name}_scale" in arrays else 1.0
            setattr(self, name, arrays[name].astype(np.float64) * scale)
        self.frames: Floats
        self.features: Floats
        self.phones, self.emotions = (arrays[name].astype(np.int64) for name in ("phones", "emotions"))
        self.starts, self.stops = (arrays[name].astype(np.int64) for name in ("starts", "stops"))
        self.feature_starts, self.feature_stops = (arrays[name].astype(np.int64) for name in ("feature_starts", "feature_stops"))
        self.run_starts, self.run_stops = (arrays[name].astype(np.int64) for name in ("run_starts", "run_stops"))
        self.before, self.after = (arrays[name].astype(np.int64) for name in ("before", "after"))
        self.metric = arrays["metric"]
        self.visemes, self.pairs, self._maps = np.array(visemes), [tuple(pair) for pair in pairs], maps
        self._known: dict[tuple[int, int], Candidates] = {}

    def __len__(self) -> int:
        return len(self.starts)

    def audio(self, node: int) -> Floats:
        """[L', P] what a node sounded like."""
        return self.features[self.feature_starts[node] : self.feature_stops[node]]

    def motion(self, node: int, number: int) -> Floats:
        """[L, D] a node's motion, through its map."""
        return self.mapped(self.frames[self.starts[node] : self.stops[node]], number)

    def following(self, node: int, count: int) -> Floats:
        """[up to count, D] the frames recorded after the node."""
        return self.frames[self.stops[node] : min(self.stops[node] + count, self.run_stops[node])]

    def preceding(self, node: int, count: int) -> Floats:
        """[up to count, D] the frames recorded before the node."""
        return self.frames[max(self.starts[node] - count, self.run_starts[node]) : self.starts[node]]

    def mapped(self, components: Floats, number: int) -> Floats:
        """[n, D] components through an emotion map; a number below 0 is no map."""
        if number < 0 or not len(components) or self._maps is None:
            return components
        whole = np.ones((1, len(components)))
        return self._maps(components=components[None], map=np.array(number, np.int64), intensity=whole)[0][0]

    def candidates(self, phone: int, emotion: int) -> Candidates:
        """Nodes of the phone, else of its viseme class, else any; with the emotion, else mapped, else of any."""
        if (phone, emotion) not in self._known:
            levels = (self.phones == phone, self.visemes[self.phones] == self.visemes[phone], np.ones(len(self), bool))
            nodes = next(np.flatnonzero(level) for level in levels if level.any())
            self._known[phone, emotion] = Candidates(*next(self.by_emotion(nodes, emotion)))
        return self._known[phone, emotion]

    def by_emotion(self, nodes: Ints, emotion: int) -> Iterator[tuple[Ints, Ints]]:
        """Nodes and their maps at the levels of emotion at which some of these nodes can be had, best first."""
        feelings = self.emotions[nodes]
        native = nodes[feelings == emotion]
        if len(native):
            yield native, np.full(len(native), -1)
        map_of = {source: number for number, (source, target) in enumerate(self.pairs) if target == emotion}
        reached = np.isin(feelings, list(map_of))
        if reached.any():
            yield nodes[reached], np.array([map_of[int(e)] for e in feelings[reached]])
        if len(nodes):
            yield nodes, np.full(len(nodes), -1)

    def sound_costs(self, wanted: Floats, nodes: Ints) -> Floats:
        """[n] how differently nodes sound from wanted [m, P]."""
        return audio_costs(wanted, self.features, self.feature_starts[nodes], self.feature_stops[nodes])

    def step(self, candidates: Candidates, before: tuple[Candidates, Step] | None, wish: Wish, weights: Weights) -> Step:
        """Costs of the candidates of one phone, after those of the phone before."""
        nodes = candidates.nodes
        ends = [self.frames[self.starts[nodes]], self.frames[self.stops[nodes] - 1]]
        for number in np.unique(candidates.maps[candidates.maps >= 0]).tolist():
            through = candidates.maps == number
            for end in ends:
                end[through] = self.mapped(end[through], number)
        first, last = (end @ self.metric for end in ends)
        audio, none = self.sound_costs(wish.wanted, nodes), np.full(len(nodes), -1, np.int64)
        pose = None if wish.expected is None else self._pose_costs(candidates, wish.expected)
        if before is None:
            return Step(audio, last, none, np.zeros((len(nodes), 0)), pose)
        place = np.full(len(self) + 1, -1, np.int64)
        place[before[0].nodes] = np.arange(len(before[0].nodes))
        link = place[self.before[nodes]]
        link = np.where((link >= 0) & (before[0].maps[link] == candidates.maps), link, -1)
        there = before[1].last
        squared = np.square(first).sum(axis=1)[:, None] + np.square(there).sum(axis=1) - 2 * first @ there.T
        jumps = weights.jump + weights.jump_cost * np.sqrt(np.maximum(squared, 0.0))
        linked = np.flatnonzero(link >= 0)
        jumps[linked, link[linked]] = np.inf
        return Step(audio, last, link, jumps, pose)

    def _pose_costs(self, candidates: Candidates, expected: Floats) -> Floats:
        """[n] mean over frames of the squared distance of each candidate, stretched evenly, to the expected pose."""
        if not len(expected):
            return np.zeros(len(candidates.nodes))
        motions = self._stretched(candidates.nodes, len(expected))
        for number in np.unique(candidates.maps[candidates.maps >= 0]).tolist():
            through = candidates.maps == number
            flat = motions[through].reshape(-1, motions.shape[2])
            motions[through] = self.mapped(flat, number).reshape(-1, *motions.shape[1:])
        apart = motions @ self.metric - expected
        return np.einsum("nkd,nkd->n", apart, apart) / len(expected)

    def _stretched(self, which: Ints, count: int) -> Floats:
        """[n, count, D] the motions of some nodes, each time-warped to `count` frames."""
        lengths = self.stops[which] - self.starts[which]
        share = np.array([0.5]) if count == 1 else np.linspace(0, 1, count)
        at = np.where(np.equal(lengths, count)[:, None], np.arange(count), (lengths - 1)[:, None] * share)
        low = np.minimum(at.astype(np.int64), np.maximum(lengths - 2, 0)[:, None])
        high = np.minimum(low + 1, (lengths - 1)[:, None])
        part, first = (at - low)[..., None], self.starts[which][:, None]
        return self.frames[first + low] * (1 - part) + self.frames[first + high] * part


def best_path(steps: Sequence[Step], weights: Weights, *, start: int | None = None) -> tuple[Ints, float]:
    """The candidates [T] of least cost (eq. 2), and that cost; `start` prescribes the first."""
    phi = weights.target(steps[0])
    if start is not None:
        phi = np.where(np.arange(len(phi)) == start, phi, np.inf)
    origins = []
    for step in steps[1:]:
        total = step.jumps + phi
        origin = total.argmin(axis=1)
        best = total[np.arange(len(total)), origin]
        free = np.where(step.link >= 0, phi[step.link], np.inf)
        origins.append(np.where(free <= best, step.link, origin))
        phi = np.minimum(free, best) + weights.target(step)
    path = [int(phi.argmin())]
    for origin in reversed(origins):
        path.append(int(origin[path[-1]]))
    return np.array(path[::-1], np.int64), float(phi.min())


def soft_path(steps: Sequence[Step], weights: Weights, temperature: float) -> list[Floats]:
    """The posterior probability [n] of each candidate of each phone."""
    moves = []
    for step in steps[1:]:
        cost, linked = step.jumps.copy(), np.flatnonzero(step.link >= 0)
        cost[linked, step.link[linked]] = 0.0
        moves.append(-cost.T / temperature)
    return posterior([-weights.target(step) / temperature for step in steps], moves).shares()


class LookAhead:
    """Steps in, candidates out: each is the first of the best path over it and the phones ahead."""

    def __init__(self, weights: Weights, phones: int) -> None:
        if phones < 1:
            raise FacesynthError(f"look_ahead is {phones}; wanted at least 1 phone (the paper has 3 to 6)")
        self.weights, self.phones = weights, phones
        self._window: list[Step] = []
        self._settled: int | None = None

    def push(self, step: Step) -> list[int]:
        """Add the next phone's candidates."""
        self._window.append(step)
        return [self._settle()] if len(self._window) - self._history > self.phones else []

    def finish(self) -> list[int]:
        """Settle what is left when the input ends."""
        return [self._settle() for _ in range(len(self._window) - self._history)]

    @property
    def _history(self) -> int:
        return 0 if self._settled is None else 1

    def _settle(self) -> int:
        path, _ = best_path(self._window, self.weights, start=self._settled)
        chosen = int(path[self._history])
        if self._history:
            self._window.pop(0)
        self._settled = chosen
        return chosen
