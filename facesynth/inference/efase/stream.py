"""Phones one by one, frames as soon as nothing that follows can change them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..arrays import Ints
from ..efase.assembly import SETTLE_S, WAKE_S
from ..efase.costs import target_costs
from ..efase.plan import Plan
from ..efase.search import Stretch
from ..efase.window import frames_between
from ..errors import FacesynthError
from ..phones import SILENCE
from ..speech import NEUTRAL, frame_bounds

if TYPE_CHECKING:
    from ..efase.model import Efase

GUARD_S = 0.4
"""Smoothing of intensities (0.32 s) and of closed lips reaches no farther, the filters of another frame rate hardly."""
HISTORY_S = 2.0
"""What lies further back no longer changes a frame."""


class EfaseStream:
    """`push` phones, get frames [n, C]; `finish` gives the rest. The whole at once gives the same frames.

    A frame is final when its own node and the next one are settled and 0.4 s of settled motion follow it.
    """

    def __init__(self, model: Efase, look_ahead: int | None, weakened: bool, fps: float) -> None:
        self.model, self.fps, self.look_ahead = model, fps, look_ahead
        self.weakened, self.plans = weakened, 2 if weakened and NEUTRAL in model.emotions else 1
        self.labels: list[str] = []
        self.ends_s: list[float] = []
        self.feelings: list[str] = []
        self.intensity: list[float] = []
        self.paths: list[list[int]] = [[] for _ in range(self.plans)]
        self.frames_out = 0
        self._stretches = [Stretch(model.index, look_ahead) for _ in range(self.plans)]

    def push(self, phone: str, end_s: float, emotion: str, intensity: float = 1.0) -> NDArray[np.float32]:
        """The next phone, to its end in seconds; the frames that became final, possibly none."""
        self._check(end_s, intensity)
        model, moods = self.model, (emotion, NEUTRAL)[: self.plans]
        queries = [model.query([phone], [mood]) for mood in moods]
        silent = phone == SILENCE and not model.settings.bridge_pauses
        if silent:
            self._end_stretch()
        self.labels.append(phone)
        self.ends_s.append(float(end_s))
        self.feelings.append(emotion)
        self.intensity.append(float(intensity))
        for path, stretch, query in zip(self.paths, self._stretches, queries, strict=True):
            if silent:
                path.append(-1)
                continue
            before = len(stretch.settled)
            stretch.push(target_costs(model.nodes, query, 0, model.weights))
            path.extend(stretch.settled[before:])
        return self._emit(last=False)

    def finish(self) -> NDArray[np.float32]:
        """The frames that were held back."""
        if not self.labels:
            raise FacesynthError("no phone was pushed; at least one is needed")
        self._end_stretch()
        return self._emit(last=True)

    def _check(self, end_s: float, intensity: float) -> None:
        before_s = self.ends_s[-1] if self.ends_s else 0.0
        if not (np.isfinite(end_s) and end_s > before_s):
            raise FacesynthError(f"the phone ends at {end_s} s; wanted an end after {before_s} s, where the one before ends")
        if not 0 <= intensity <= 1:
            raise FacesynthError(f"intensity is {intensity}; wanted 0 (neutral) to 1 (as recorded)")
        if intensity < 1 and not self.weakened:
            raise FacesynthError(f"intensity is {intensity}; a stream of intensities below 1 is opened with weakened=True")

    def _end_stretch(self) -> None:
        for path, stretch in zip(self.paths, self._stretches, strict=True):
            path.extend(stretch.finish()[len(stretch.settled) :].tolist())
        self._stretches = [Stretch(self.model.index, self.look_ahead) for _ in range(self.plans)]

    def _emit(self, *, last: bool) -> NDArray[np.float32]:
        known = min(len(path) for path in self.paths)
        nothing = np.zeros((0, self.model.layout.dimension * len(self.model.layout.names)), np.float32)
        if known == 0:
            return nothing
        bounds = frame_bounds(np.array(self.ends_s[:known]), self.model.database_fps)
        if last:
            stop = int(frame_bounds(np.array(self.ends_s), self.fps)[-1])
        else:
            final_s = self._final(bounds, known) / self.model.database_fps - GUARD_S
            stop = int(np.floor(final_s * self.fps)) if final_s > 0 else 0
        if stop <= self.frames_out:
            return nothing
        frames = self._between(self.frames_out, stop, bounds, known)
        self.frames_out = stop
        return frames

    def _final(self, bounds: Ints, known: int) -> int:
        """Frames of the database's rate that no later phone changes, the reach of smoothing left aside."""
        first = known - 1
        while first > 0 and self.labels[first - 1] == self.labels[first] == SILENCE:
            first -= 1
        if self.labels[known - 1] != SILENCE:
            return int(bounds[known - 1])
        fps = self.model.database_fps
        wake, length = round(WAKE_S * fps), int(bounds[known] - bounds[first])
        long = length > round(SETTLE_S * fps) + wake or first == 0
        return int(bounds[known]) - wake if long else int(bounds[first])

    def _between(self, start: int, stop: int, bounds: Ints, known: int) -> NDArray[np.float32]:
        """Frames start … stop - 1 at the stream's rate, from the phones that can matter to them."""
        model = self.model
        oldest = (start / self.fps - HISTORY_S) * model.database_fps
        first = max(0, int(np.searchsorted(bounds, oldest, side="right")) - 1)
        zero = int(bounds[first])
        own = slice(first, known)
        query = model.query(self.labels[own], self.feelings[own])
        plans = [Plan(query, np.array(path[own], np.int64), 0.0) for path in self.paths]
        frames = model.frames(plans, self.labels[own], self.feelings[own], np.array(self.intensity[own]), bounds[first:] - zero)
        made = frames_between(frames, zero, int(bounds[-1]), model.database_fps, start, stop, self.fps)
        if model.layout.kind == "curves":
            made = np.clip(made, 0.0, 1.0)
        return made.astype(np.float32)
