"""What comes in piece by piece, frames as soon as nothing that follows can change them (Cao 2005, §4.2)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..closures import ClosingLips
from ..errors import FacesynthError
from ..phones import BILABIALS, PHONES
from .assembly import LATER, Blender, make_piece
from .candidates import Candidates, make_step
from .hearing import Ear
from .plan import Wish
from .search import LookAhead, Step, best_path, path_cost

if TYPE_CHECKING:
    from .model import AnimeGraph


class WishStream:
    """Feed it the phones of an utterance one by one; it gives frames [n, C] of the face as soon as they are final.

    A frame is final when `look_ahead` phones after its own are known, two more nodes are settled and `guard` frames of
    motion follow it, which its filter is shown together with `remembered` ones before it: the whole motion's frame, to
    rounding, where both are as many as the filter reaches (`LowPass.settles_frames`). Near a p, b or m it is final when
    no closure can touch it.
    """

    def __init__(self, model: AnimeGraph, look_ahead: int, guard: int, remembered: int) -> None:
        self.model, self.search = model, LookAhead(model.weights, look_ahead)
        self.guard, self.remembered = guard, remembered
        self.blender = Blender(model.chooser, model.fps, help_pairs=model.help_pairs)
        self.lips = ClosingLips(model.layout, model.closed_gap, model.fps)
        self.asked: list[tuple[Wish, Candidates]] = []
        self.steps: list[Step] = []
        self.path: list[int] = []
        self._blended = np.zeros((0, len(model.metric)))
        self._announced = self._pieces_done = self._smooth_done = 0

    def push(self, wish: Wish) -> NDArray[np.float32]:
        """The next phone."""
        self.announce(wish.phone, wish.frames)
        return self.fulfil(wish)

    def announce(self, phone: int, frames: int) -> None:
        """A phone that is going to be asked for: lips that close at it must be known before its sound is."""
        start, self._announced = self._announced, self._announced + frames
        if PHONES[phone] in BILABIALS:
            self.lips.expect(start, self._announced)

    def fulfil(self, wish: Wish) -> NDArray[np.float32]:
        """The next phone, which was announced."""
        candidates = self.model.chooser.candidates(wish.phone, wish.emotion)
        before = self.asked[-1][1] if self.asked else None
        self.asked.append((wish, candidates))
        self.steps.append(make_step(self.model.chooser, candidates, before, wish.wanted, self.model.metric, wish.expected))
        self._settle(self.search.push(self.steps[-1]))
        return self._emit(last=False)

    def finish(self) -> NDArray[np.float32]:
        """The frames that were held back."""
        self._settle(self.search.finish())
        return self._emit(last=True)

    @property
    def extra_cost(self) -> float:
        """Share by which the path so far costs more than the best one: what looking only some phones ahead loses."""
        done = self.steps[: len(self.path)]
        optimum = best_path(done, self.model.weights)[1] if done else 0.0
        return max(0.0, path_cost(done, self.path, self.model.weights) / optimum - 1) if optimum > 0 else 0.0

    def _settle(self, chosen: list[int]) -> None:
        for candidate in chosen:
            t = len(self.path)
            captured = t > 0 and bool(self.steps[t].link[candidate] == self.path[-1])
            self.blender.add(make_piece(self.model.chooser, *self.asked[t], candidate), captured)
            self.path.append(candidate)

    def _emit(self, *, last: bool) -> NDArray[np.float32]:
        model, ready = self.model, len(self.blender.jumps) - (0 if last else LATER)
        fresh = [self.blender.final(t) for t in range(self._pieces_done, ready)]
        self._pieces_done = max(self._pieces_done, ready)
        self._blended = np.concatenate([self._blended, *fresh])
        stop = max(self._smooth_done, len(self._blended) - (0 if last else self.guard))
        start = max(0, self._smooth_done - self.remembered)
        smooth = self._blended[:0]
        if stop > self._smooth_done:
            smooth = model.low_pass(self._blended[start:])[self._smooth_done - start : stop - start]
        self._smooth_done = stop
        final = [self.lips.push(model.decode(smooth)), *([self.lips.finish()] if last else [])]
        return np.concatenate(final).astype(np.float32)


class AnimeStream:
    """`hear` sound and `push` phones, in any order and in pieces of any size; both give the frames [n, C] that became final.

    A phone waits for its sound; then see `WishStream`.
    """

    def __init__(self, model: AnimeGraph, ear: Ear, look_ahead: int) -> None:
        settles = model.low_pass.settles_frames
        self.model, self.ear, self.wishes = model, ear, WishStream(model, look_ahead, settles, settles)
        self._waiting: list[tuple[int, int, float, float]] = []
        """Phone, emotion, start and end in seconds of the phones that wait for their sound."""
        self._end_s = 0.0

    def hear(self, audio: ArrayLike) -> NDArray[np.float32]:
        """More sound [S] at the model's rate."""
        self.ear.hear(audio)
        return self._advance()

    def push(self, phone: str, end_s: float, emotion: str) -> NDArray[np.float32]:
        """The next phone, to its end in seconds."""
        if not (np.isfinite(end_s) and end_s > self._end_s):
            raise FacesynthError(f"the phone ends at {end_s} s; wanted an end after {self._end_s} s, where the one before ends")
        phone_number, emotion_number = self.model.numbers(phone, emotion)
        self._waiting.append((phone_number, emotion_number, self._end_s, float(end_s)))
        self.wishes.announce(phone_number, self._frames(self._end_s, float(end_s)))
        self._end_s = float(end_s)
        return self._advance()

    def finish(self) -> NDArray[np.float32]:
        """The frames that were held back."""
        if not (self._waiting or self.wishes.asked) or not self.ear.samples:
            raise FacesynthError("wanted sound and at least one phone before the end")
        self.ear.finish()
        return np.concatenate([self._advance(last=True), self.wishes.finish()])

    def _advance(self, *, last: bool = False) -> NDArray[np.float32]:
        fps, features = self.model.feature_fps, self.ear.features
        frames = [np.zeros((0, self.model.layout.channels), np.float32)]
        while self._waiting:
            phone, emotion, start_s, end_s = self._waiting[0]
            start, stop = round(start_s * fps), round(end_s * fps)
            if not last and len(features) < max(stop, start + 1):
                break
            self._waiting.pop(0)
            start = min(start, len(features) - 1)
            heard = features[start : max(min(stop, len(features)), start + 1)]
            frames.append(self.wishes.fulfil(Wish(phone, emotion, heard, self._frames(start_s, end_s))))
        return np.concatenate(frames)

    def _frames(self, start_s: float, end_s: float) -> int:
        return round(end_s * self.model.fps) - round(start_s * self.model.fps)
