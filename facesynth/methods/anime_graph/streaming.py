"""Phones in, motion out: the look-ahead search with blending and smoothing that follow it (Cao 2005, §4.2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.closures import ClosingLips
from facesynth.inference.phones import BILABIALS, PHONES
from facesynth.methods.anime_graph.assembly import Blender
from facesynth.methods.anime_graph.candidates import Candidates, Chooser, make_step
from facesynth.methods.anime_graph.components import FaceComponents
from facesynth.methods.anime_graph.lowpass import low_pass
from facesynth.methods.anime_graph.plan import Wish, make_piece
from facesynth.methods.anime_graph.search import LookAhead, Step, Weights, best_path, path_cost

FILTER_SETTLES_S = 0.25
"""The zero-phase filter needs to see this much of what follows a frame."""
FILTER_REMEMBERS_S = 1.0
"""What lies further back no longer changes a filtered frame."""


class Stream:
    """Feed it the phones of an utterance one by one; it gives frames of components as soon as they are final.

    A frame is final when `look_ahead` phones after its own are known, two more nodes are settled and a quarter of a
    second of motion follows it.
    """

    def __init__(
        self,
        chooser: Chooser,
        weights: Weights,
        *,
        metric: NDArray[np.float64],
        cutoffs_hz: NDArray[np.float64],
        fps: float,
        look_ahead: int,
    ) -> None:
        self.chooser, self.weights, self.metric, self.cutoffs_hz, self.fps = chooser, weights, metric, cutoffs_hz, fps
        self.search = LookAhead(weights, look_ahead)
        self.blender = Blender(chooser, fps)
        self.wishes: list[Wish] = []
        self.candidates: list[Candidates] = []
        self.steps: list[Step] = []
        self.path: list[int] = []
        self._blended = np.zeros((0, len(cutoffs_hz)))
        self._pieces_done = 0
        self._frames_out = 0

    def push(self, wish: Wish) -> NDArray[np.float64]:
        """The next phone; returns the frames [n, D] that became final, possibly none."""
        candidates = self.chooser.candidates(wish.phone, wish.emotion)
        before = self.candidates[-1] if self.candidates else None
        self.wishes.append(wish)
        self.candidates.append(candidates)
        self.steps.append(make_step(self.chooser, candidates, before, wish.wanted, self.metric, wish.expected))
        self._settle(self.search.push(self.steps[-1]))
        return self._emit(round(FILTER_SETTLES_S * self.fps), pieces_unsettled=2)

    def finish(self) -> NDArray[np.float64]:
        """The frames [n, D] that were held back."""
        self._settle(self.search.finish())
        return self._emit(0, pieces_unsettled=0)

    @property
    def cost(self) -> float:
        """Eq. 2 of the path so far; the global optimum costs this or less."""
        return path_cost(self.steps[: len(self.path)], np.array(self.path), self.weights)

    @property
    def extra_cost(self) -> float:
        """Share by which the path so far costs more than the best one for the same phones."""
        optimum = best_path(self.steps[: len(self.path)], self.weights)[1] if self.path else 0.0
        return max(0.0, self.cost / optimum - 1) if optimum > 0 else 0.0

    def _settle(self, chosen: list[int]) -> None:
        for candidate in chosen:
            t = len(self.path)
            captured = t > 0 and bool(self.steps[t].link[candidate] == self.path[-1])
            self.blender.add(make_piece(self.chooser, self.wishes[t], self.candidates[t], candidate), captured)
            self.path.append(candidate)

    def _emit(self, held_back: int, pieces_unsettled: int) -> NDArray[np.float64]:
        ready = len(self.blender.pieces) - pieces_unsettled
        fresh = [self.blender.blended(t) for t in range(self._pieces_done, ready)]
        self._pieces_done = max(self._pieces_done, ready)
        self._blended = np.concatenate([self._blended, *fresh])
        stop = max(self._frames_out, len(self._blended) - held_back)
        start = max(0, self._frames_out - round(FILTER_REMEMBERS_S * self.fps))
        smooth = low_pass(self._blended[start:], self.cutoffs_hz, self.fps)
        final = smooth[self._frames_out - start : stop - start]
        self._frames_out = stop
        return final


class FaceStream:
    """Phones in, frames of the face out: what `Stream` finds, decoded, with lips that close at p, b and m."""

    def __init__(self, stream: Stream, components: FaceComponents, lips: ClosingLips) -> None:
        self.components_stream, self.components, self.lips = stream, components, lips
        self._frames_asked = 0

    def push(self, wish: Wish) -> NDArray[np.float32]:
        """The next phone; returns the frames [n, C] that became final, possibly none."""
        start, self._frames_asked = self._frames_asked, self._frames_asked + wish.frames
        if PHONES[wish.phone] in BILABIALS:
            self.lips.expect(start, self._frames_asked)
        return self._closed(self.components_stream.push(wish))

    def finish(self) -> NDArray[np.float32]:
        """The frames [n, C] that were held back."""
        closed = self._closed(self.components_stream.finish())
        return np.concatenate([closed, self.lips.finish().astype(np.float32)])

    @property
    def extra_cost(self) -> float:
        """Share by which the path costs more than the best one: what looking only some phones ahead loses."""
        return self.components_stream.extra_cost

    def _closed(self, components: NDArray[np.float64]) -> NDArray[np.float32]:
        return self.lips.push(self.components.decode_array(components)).astype(np.float32)
