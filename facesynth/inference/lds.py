"""The linear dynamical system: sound in, frames out, at once or as the sound comes in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .checks import checked_audio, checked_piece, checked_rate, checked_seed, require_open
from .errors import FacesynthError, reject_options
from .folder import Folder
from .graphs import Graph
from .layout import Layout
from .motion import Motion
from .sound import resample

MOST_FRAMES = 1024
"""Frames computed at once: memory does not grow with the sound."""


@dataclass(frozen=True, eq=False)
class LdsState:
    """All that a stream remembers between two pieces of sound."""

    system: NDArray[np.float32]
    """[1, n] state of the system before the next frame."""
    heard: NDArray[np.float32]
    """[S'] the sound that later frames need."""
    first: int
    """Which sample `heard` begins with, counted from the start of the sound."""
    frames: int
    """How many frames were given out."""
    noise: float
    random: Mapping[str, Any]
    """State of the generator that draws the innovations."""

    @property
    def samples(self) -> int:
        """How many samples were fed."""
        return self.first + len(self.heard)


class Lds:
    """A folder exported from an `lds` model."""

    def __init__(self, folder: Folder, threads: int) -> None:
        manifest = folder.manifest
        self.manifest = manifest
        self.fps, self.rate = float(manifest["fps"]), int(manifest["sample_rate"])
        self.layout, self.emotions = Layout.from_dict(manifest["layout"]), tuple(manifest["emotions"])
        self.settings, self._look_ahead_s = folder.settings, float(manifest["latency"]["look_ahead_s"])
        self._window, self._lead_s = int(self.settings["window_samples"]), float(self.settings["lead_ms"]) / 1000
        self._settling_s, self._inputs = float(self.settings["settling_s"]), int(self.settings["features"])
        self._components, self._states = int(self.settings["components"]), int(self.settings["states"])
        self.features, self.innovations, self.rollout = (
            Graph(folder, g, threads) for g in ("features", "innovations", "rollout")
        )

    @property
    def look_ahead_s(self) -> float:
        """Frame t waits for the sound up to t / fps + this, seconds."""
        return self._look_ahead_s

    def synthesize(self, speech: Any, *, seed: int = 0, noise: float = 1.0, **options: Any) -> Motion:
        """Motion for speech, of which only the sound counts; `noise` 1 as recorded, 0 the deterministic part alone."""
        reject_options("lds", options, ("seed", "noise"))
        count = max(1, int(speech.phones.frame_bounds(self.fps)[-1]))
        audio = resample(checked_audio(speech.audio), speech.sample_rate, self.rate)
        state = replace(self.start(seed=seed, noise=noise), heard=audio)
        frames, _ = self._frames(state, count)
        return Motion(frames, self.fps, self.layout)

    def start(self, *, seed: int = 0, noise: float = 1.0) -> LdsState:
        """The state before the first sample: the noise has already run for some seconds."""
        if not (np.isfinite(noise) and noise >= 0):
            raise FacesynthError(f"noise is {noise}; wanted 0 (none), 1 (as recorded) or another number that is not negative")
        rng = np.random.default_rng(checked_seed(seed))
        count = round(self._settling_s * self.fps)
        no_sound = np.zeros((1, count, self._inputs), np.float32)
        rest = np.zeros((1, self._states), np.float32)
        _, system = self.rollout(features=no_sound, innovations=self._draw(rng, count, noise), state=rest)
        return LdsState(system, np.zeros(0, np.float32), 0, 0, noise, rng.bit_generator.state)

    def advance(self, state: LdsState, audio: ArrayLike) -> tuple[NDArray[np.float32], LdsState]:
        """More sound [S] at the model's rate: the frames [t, C] that became final, possibly none, and the state after them."""
        state = replace(state, heard=np.concatenate([state.heard, checked_piece(audio)]))
        ready = int(np.searchsorted(self._stops(state.frames, self._most(state)), state.samples, side="right"))
        return self._frames(state, min(state.frames + ready, self._most(state)))

    def finish(self, state: LdsState) -> tuple[NDArray[np.float32], LdsState]:
        """The frames that were held back: after the end there is silence."""
        return self._frames(state, max(1, self._most(state)))

    def stream(self, *, seed: int = 0, noise: float = 1.0, sample_rate: int | None = None) -> LdsStream:
        """Sound in pieces of any size; `sample_rate` must be the model's."""
        checked_rate(self.rate if sample_rate is None else sample_rate, self.rate)
        return LdsStream(self, self.start(seed=seed, noise=noise))

    def _most(self, state: LdsState) -> int:
        """Frames of the sound so far."""
        return round(state.samples / self.rate * self.fps)

    def _starts(self, first: int, stop: int) -> NDArray[np.int64]:
        """[stop - first] first sample of each frame's window, counted from the start of the sound."""
        times_s = (np.arange(first, max(first, stop)) + 0.5) / self.fps + self._lead_s
        return np.round(times_s * self.rate).astype(np.int64) - self._window // 2

    def _stops(self, first: int, stop: int) -> NDArray[np.int64]:
        return self._starts(first, stop) + self._window

    def _frames(self, state: LdsState, stop: int) -> tuple[NDArray[np.float32], LdsState]:
        """Frames from the state's next up to `stop`; sound that is not there is silence."""
        done = [np.zeros((0, self.layout.dimension * len(self.layout.names)), np.float32)]
        rng = np.random.default_rng(0)
        rng.bit_generator.state = state.random
        system = state.system
        for first in range(state.frames, stop, MOST_FRAMES):
            last = min(first + MOST_FRAMES, stop)
            _, features = self.features(windows=self._windows(state, first, last))
            frames, system = self.rollout(features=features, innovations=self._draw(rng, last - first, state.noise), state=system)
            done.append(frames[0])
        stop = max(stop, state.frames)
        kept = int(np.clip(self._starts(stop, stop + 1)[0] - state.first, 0, len(state.heard)))
        heard, first_kept = state.heard[kept:], state.first + kept
        return np.concatenate(done), LdsState(system, heard, first_kept, stop, state.noise, rng.bit_generator.state)

    def _windows(self, state: LdsState, first: int, stop: int) -> NDArray[np.float32]:
        """[1, T, L]"""
        length = self._window
        starts = self._starts(first, stop) - state.first
        before, after = max(0, -int(starts[0])), max(0, int(starts[-1]) + length - len(state.heard))
        low = max(0, int(starts[0]))
        sound = np.pad(state.heard[low : max(low, int(starts[-1]) + length)], (before, after))
        return sound[(starts - starts[0])[:, None] + np.arange(length)][None]

    def _draw(self, rng: np.random.Generator, count: int, noise: float) -> NDArray[np.float32]:
        """[1, count, p]"""
        uniform = rng.random((count, self._components)).astype(np.float32)[None]
        return np.float32(noise) * self.innovations(uniform=uniform)[0]


class LdsStream:
    """`push` sound, get frames; `state` may be kept and given to another stream."""

    def __init__(self, model: Lds, state: LdsState) -> None:
        self.model, self.state, self._ended = model, state, False

    def push(self, audio: ArrayLike) -> NDArray[np.float32]:
        """More sound [S]; the frames [t, C] that became final."""
        require_open(self._ended)
        frames, self.state = self.model.advance(self.state, audio)
        return frames

    def finish(self) -> NDArray[np.float32]:
        """The frames that were held back."""
        require_open(self._ended)
        self._ended = True
        frames, self.state = self.model.finish(self.state)
        return frames
