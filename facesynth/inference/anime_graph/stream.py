"""Sound and phones as they come in, frames as soon as nothing that follows can change them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..anime_graph.assembly import make_piece
from ..anime_graph.graph import Candidates, LookAhead, Step, Wish
from ..closures import ClosingLips
from ..errors import FacesynthError
from ..phones import BILABIALS

if TYPE_CHECKING:
    from ..anime_graph.model import AnimeGraph


class AnimeStream:
    """`hear` sound and `push` phones, in any order and in pieces of any size; both give the frames [n, C] that became final.

    A phone waits for its sound. A frame is final when `look_ahead` phones after its own are known, two more nodes are
    settled and as much motion follows it as its filter reaches (`model.settles_frames`).
    """

    def __init__(self, model: AnimeGraph, look_ahead: int) -> None:
        self.model, self.search = model, LookAhead(model.weights, look_ahead)
        self.ear, self.blender = model.ear(), model.blender()
        self._asked: list[tuple[int, int, float, float]] = []
        """Phone, emotion, start and end in seconds of the phones that wait for their sound."""
        self._end_s = 0.0
        self._steps: list[tuple[Wish, Candidates, Step]] = []
        self._path: list[int] = []
        self._blended = np.zeros((0, model.nodes.metric.shape[0]))
        self._pieces_done = self._smooth_done = 0
        self._lips = ClosingLips(model.layout, model.closed_gap, model.fps)

    def hear(self, audio: ArrayLike) -> NDArray[np.float32]:
        """More sound [S] at the model's rate."""
        self.ear.hear(audio)
        return self._advance()

    def push(self, phone: str, end_s: float, emotion: str) -> NDArray[np.float32]:
        """The next phone, to its end in seconds."""
        if not (np.isfinite(end_s) and end_s > self._end_s):
            raise FacesynthError(f"the phone ends at {end_s} s; wanted an end after {self._end_s} s, where the one before ends")
        self._asked.append((*self.model.numbers(phone, emotion), self._end_s, float(end_s)))
        start, stop = round(self._end_s * self.model.fps), round(float(end_s) * self.model.fps)
        if phone in BILABIALS:
            self._lips.expect(start, stop)
        self._end_s = float(end_s)
        return self._advance()

    def finish(self) -> NDArray[np.float32]:
        """The frames that were held back."""
        if not (self._asked or self._steps) or not self.ear.samples:
            raise FacesynthError("wanted sound and at least one phone before the end")
        self.ear.finish()
        frames = self._advance(last=True)
        self._settle(self.search.finish())
        return np.concatenate([frames, self._emit(last=True)])

    def _advance(self, *, last: bool = False) -> NDArray[np.float32]:
        fps, model, features = self.model.settings["feature_fps"], self.model, self.ear.features
        while self._asked:
            phone, emotion, start_s, end_s = self._asked[0]
            start, stop = round(start_s * fps), round(end_s * fps)
            if not last and len(features) < max(stop, start + 1):
                break
            self._asked.pop(0)
            start = min(start, len(features) - 1)
            frames = round(end_s * model.fps) - round(start_s * model.fps)
            wish = Wish(phone, emotion, features[start : max(min(stop, len(features)), start + 1)], frames)
            candidates = model.nodes.candidates(phone, emotion)
            before = self._steps[-1][1:] if self._steps else None
            step = model.nodes.step(candidates, before, wish, model.weights)
            self._steps.append((wish, candidates, step))
            self._settle(self.search.push(step))
        return self._emit(last=False)

    def _settle(self, chosen: list[int]) -> None:
        for candidate in chosen:
            t = len(self._path)
            wish, candidates, step = self._steps[t]
            captured = t > 0 and bool(step.link[candidate] == self._path[-1])
            self.blender.add(make_piece(self.model.nodes, wish, candidates, candidate), captured)
            self._path.append(candidate)

    def _emit(self, *, last: bool) -> NDArray[np.float32]:
        model, ready = self.model, len(self.blender.pieces) - (0 if last else 2)
        fresh = [self.blender.blended(t) for t in range(self._pieces_done, ready)]
        self._pieces_done = max(self._pieces_done, ready)
        self._blended = np.concatenate([self._blended, *fresh])
        stop = max(self._smooth_done, len(self._blended) - (0 if last else model.settles_frames))
        start = max(0, self._smooth_done - model.settles_frames)
        smooth = model.low_pass(self._blended[start:])[self._smooth_done - start : stop - start]
        self._smooth_done = stop
        final = [self._lips.push(model.decode(smooth)), *([self._lips.finish()] if last else [])]
        return np.concatenate(final).astype(np.float32)
