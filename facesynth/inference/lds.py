"""The linear dynamical system: sound in, frames out, at once or as the sound comes in."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .arrays import Floats
from .checks import checked_audio, checked_piece, checked_rate, checked_seed, require_open
from .closures import close_at
from .errors import FacesynthError, reject_options
from .folder import MANIFEST, Folder
from .graphs import Graph, Part
from .heard_input import HeardInput, exported_input
from .layout import Layout
from .lips import bilabial_spans
from .motion import Motion
from .sound import resample
from .speech_state import STATES, amounts_along
from .windows import FrameWindows

AHEAD_S = 0.4
"""How far the windows in which a stream hears with the phone network reach ahead, unless told otherwise, seconds."""
MOST_FRAMES = 1024
"""Frames computed at once: memory does not grow with the sound."""

Heard = tuple[NDArray[np.float32], int]
"""Features [F, W] of the sound, and the number of the first of them."""


@dataclass(frozen=True, eq=False)
class LdsState:
    """All that a stream remembers between two pieces of sound."""

    system: NDArray[np.float32]
    """[1, n] state of the system before the next frame."""
    plain: NDArray[np.float32]
    """[1, n] the same of a system without noise."""
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


@dataclass(frozen=True)
class LdsSettings:
    """Numbers that a system runs with, as a folder's manifest states them."""

    window_samples: int
    """Of the sound heard for one frame."""
    lead_ms: float
    """How far the sound is looked ahead."""
    settling_s: float
    """How long the noise runs before the first frame, so that it starts as it goes on."""
    features: int
    """Of the sound, m."""
    components: int
    """Of the shape, p."""
    states: int
    """n"""
    noise_amounts: Mapping[str, float] = field(default_factory=lambda: dict.fromkeys(STATES, 1.0))
    """How much of the noise belongs to each state of the speech; without phones `unknown` counts."""
    closed_gap: float | None = None
    """How near the lips come at a p, b or m; None: they are left as they are."""
    closing: tuple[float, ...] | None = None
    """[C] how the whole face moves as the lips come nearer by one unit, see `closing_direction`; None: lips alone move."""

    @classmethod
    def from_dict(cls, plain: Mapping[str, Any]) -> Self:
        """From a manifest's settings, which may hold more."""
        window, lead_ms, settling_s = int(plain["window_samples"]), float(plain["lead_ms"]), float(plain["settling_s"])
        features, components, states = (int(plain[name]) for name in ("features", "components", "states"))
        amounts = {name: float(plain["noise_amounts"][name]) for name in STATES}
        along = plain.get("closing")
        closing = None if along is None else tuple(map(float, along))
        return cls(window, lead_ms, settling_s, features, components, states, amounts, plain["closed_gap"], closing)

    def windows(self, fps: float, rate: int) -> FrameWindows:
        """Of sound at a rate in Hz, for frames at `fps`."""
        return FrameWindows(fps, rate, self.window_samples, self.lead_ms / 1000)


class Lds:
    """A trained system, whether its parts are graphs of a folder or modules of torch.

    Parts are called with named arrays: `features(windows [1, T, L])` gives the periodogram and the input [1, T, m],
    `innovations(uniform [1, T, p])` the noise [1, T, p], `rollout(features, innovations, state [1, n])` the frames
    [1, T, C] and the state after them. `heard` gives the input in place of `features`, which is not called then.
    """

    def __init__(
        self,
        layout: Layout,
        emotions: tuple[str, ...],
        windows: FrameWindows,
        settings: LdsSettings,
        *,
        features: Part,
        innovations: Part,
        rollout: Part,
        heard: HeardInput | None = None,
        manifest: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        self.layout, self.emotions, self.windows, self.settings = layout, emotions, windows, settings
        self.features, self.innovations, self.rollout, self.heard = features, innovations, rollout, heard
        self.fps, self.rate, self.manifest = windows.fps, windows.rate, manifest

    @property
    def look_ahead_s(self) -> float:
        """In a stream frame t waits for the sound up to t / fps + this, seconds, or less."""
        return self.windows.look_ahead_s if self.heard is None else self.heard.look_ahead_s(AHEAD_S)

    def synthesize(self, speech: Any, *, seed: int = 0, noise: float = 1.0, **options: Any) -> Motion:
        """Motion for speech; `noise` 1 as learned, 0 the deterministic part alone.

        The system hears the sound alone. Where phones are given they say how much noise there is, and where lips are shut.
        """
        reject_options("lds", options, ("seed", "noise"))
        count = max(1, int(speech.phones.frame_bounds(self.fps)[-1]))
        audio = resample(checked_audio(speech.audio), speech.sample_rate, self.rate)
        state = replace(self.start(seed=seed, noise=noise), heard=audio)
        amounts = amounts_along(self.settings.noise_amounts, speech.phones, self.fps, count)
        frames, _ = self._frames(state, count, amounts, None if self.heard is None else (self.heard.listening(audio), 0))
        if self.settings.closed_gap is not None:
            spans = bilabial_spans(speech.phones, self.fps)
            along = None if self.settings.closing is None else np.array(self.settings.closing)
            closed = close_at(frames.astype(np.float64), self.layout, spans, self.settings.closed_gap, self.fps, along)
            frames = closed.astype(np.float32)
        return Motion(frames, self.fps, self.layout)

    def start(self, *, seed: int = 0, noise: float = 1.0) -> LdsState:
        """The state before the first sample: the noise has already run for some seconds."""
        if not (np.isfinite(noise) and noise >= 0):
            raise FacesynthError(f"noise is {noise}; wanted 0 (none), 1 (as recorded) or another number that is not negative")
        rng = np.random.default_rng(checked_seed(seed))
        count = round(self.settings.settling_s * self.fps)
        no_sound = np.zeros((1, count, self.settings.features), np.float32)
        rest = np.zeros((1, self.settings.states), np.float32)
        _, system = self.rollout(features=no_sound, innovations=self._draw(rng, count, noise), state=rest)
        return LdsState(system, rest, np.zeros(0, np.float32), 0, 0, noise, rng.bit_generator.state)

    def advance(self, state: LdsState, audio: ArrayLike) -> tuple[NDArray[np.float32], LdsState]:
        """More sound [S] at the model's rate: the frames [t, C] that became final, possibly none, and the state after them.

        FacesynthError for a system whose hearing must be remembered too: it streams by `stream`.
        """
        if self.heard is not None:
            raise FacesynthError("what this system hears is no part of its state; push the sound into model.stream()")
        state = replace(state, heard=np.concatenate([state.heard, checked_piece(audio)]))
        stops = self.windows.starts(state.frames, self._most(state)) + self.windows.length
        ready = int(np.searchsorted(stops, state.samples, side="right"))
        return self._frames(state, min(state.frames + ready, self._most(state)))

    def finish(self, state: LdsState) -> tuple[NDArray[np.float32], LdsState]:
        """The frames that were held back: after the end there is silence."""
        return self._frames(state, max(1, self._most(state)))

    def stream(
        self, *, seed: int = 0, noise: float = 1.0, sample_rate: int | None = None, ahead_s: float = AHEAD_S
    ) -> "LdsStream | HeardLdsStream":
        """Sound in pieces of any size; `sample_rate` must be the model's. `ahead_s` is how far the windows of the phone network
        reach ahead, for a system that hears with it: what comes out depends on it a little.
        """
        checked_rate(self.rate if sample_rate is None else sample_rate, self.rate)
        state = self.start(seed=seed, noise=noise)
        return LdsStream(self, state) if self.heard is None else HeardLdsStream(self, state, ahead_s)

    def _most(self, state: LdsState) -> int:
        """Frames of the sound so far."""
        return round(state.samples / self.rate * self.fps)

    def _frames(
        self, state: LdsState, stop: int, amounts: Floats | None = None, known: "Heard | None" = None
    ) -> tuple[NDArray[np.float32], LdsState]:
        """Frames from the state's next up to `stop`; sound that is not there is silence.

        The system is linear, so that what the noise adds is the difference to a system without; `amounts` [stop] of it are
        taken, of speech whose phones nobody knows where they are not given.
        """
        done = [np.zeros((0, self.layout.channels), np.float32)]
        rng = np.random.default_rng(0)
        rng.bit_generator.state = state.random
        system, plain, unknown = state.system, state.plain, self.settings.noise_amounts["unknown"]
        for first in range(state.frames, stop, MOST_FRAMES):
            last = min(first + MOST_FRAMES, stop)
            features = self._input(state, first, last, known)
            drawn = self._draw(rng, last - first, state.noise)
            frames, system = self.rollout(features=features, innovations=drawn, state=system)
            still, plain = self.rollout(features=features, innovations=np.zeros_like(drawn), state=plain)
            amount = np.full(last - first, unknown) if amounts is None else amounts[first:last]
            done.append(still[0] + amount.astype(np.float32)[:, None] * (frames[0] - still[0]))
        stop = max(stop, state.frames)
        kept = int(np.clip(self.windows.starts(stop, stop + 1)[0] - state.first, 0, len(state.heard)))
        heard, first_kept = state.heard[kept:], state.first + kept
        return np.concatenate(done), LdsState(system, plain, heard, first_kept, stop, state.noise, rng.bit_generator.state)

    def _input(self, state: LdsState, first: int, last: int, known: "Heard | None") -> NDArray[np.float32]:
        """[1, last - first, m]"""
        if self.heard is not None and known is not None:
            return self.heard.at(known[0], first, last, known[1])[None]
        features: NDArray[np.float32]
        _, features = self.features(windows=self.windows.cut(state.heard, state.first, first, last)[None])
        return features

    def _draw(self, rng: np.random.Generator, count: int, noise: float) -> NDArray[np.float32]:
        """[1, count, p]"""
        uniform = rng.random((count, self.settings.components)).astype(np.float32)[None]
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


class HeardLdsStream:
    """The same of a system that hears with a network: what is heard is remembered here."""

    def __init__(self, model: Lds, state: LdsState, ahead_s: float) -> None:
        if model.heard is None:
            raise FacesynthError("this system hears periodograms; take LdsStream")
        self.model, self.state, self._input, self._ended = model, state, model.heard, False
        self.look_ahead_s = self._input.look_ahead_s(ahead_s)
        """Frame t is final when the sound up to t / fps + this is known, or earlier, seconds."""
        self._pieces, self._samples = self._input.listening.pieces(ahead_s), 0
        self._heard, self._first = np.zeros((0, self._input.weights.shape[1]), np.float32), 0

    def push(self, audio: ArrayLike) -> NDArray[np.float32]:
        """More sound [S]; the frames [t, C] that became final."""
        require_open(self._ended)
        sound = checked_piece(audio)
        self._samples += len(sound)
        self._hear(sound)
        return self._give(self._input.frames_known(self._first + len(self._heard)))

    def finish(self) -> NDArray[np.float32]:
        """The frames that were held back; of no sound at all, none."""
        require_open(self._ended)
        self._ended = True
        if not self._samples:
            return np.zeros((0, self.model.layout.channels), np.float32)
        self._hear(np.zeros(0, np.float32), ended=True)
        return self._give(max(1, round(self._samples / self.model.rate * self.model.fps)))

    def _hear(self, sound: NDArray[np.float32], *, ended: bool = False) -> None:
        heard = self._pieces.push(sound, ended=ended)
        if len(heard):
            self._heard = np.concatenate([self._heard, heard])

    def _give(self, stop: int) -> NDArray[np.float32]:
        frames, self.state = self.model._frames(self.state, stop, None, (self._heard, self._first))
        kept = int(np.clip(self._input.first_needed(self.state.frames) - self._first, 0, max(0, len(self._heard) - 1)))
        self._heard, self._first = self._heard[kept:], self._first + kept
        return frames


def load_lds(folder: Folder, threads: int) -> Lds:
    """The system that an `lds` model was exported to."""
    _require_new(folder)
    manifest, settings = folder.manifest, LdsSettings.from_dict(folder.settings)
    fps = float(manifest["fps"])
    windows = settings.windows(fps, int(manifest["sample_rate"]))
    heard = exported_input(folder, fps, threads)
    features: Part = Graph(folder, "features", threads) if heard is None else _no_periodogram
    parts = {name: Graph(folder, name, threads) for name in ("innovations", "rollout")}
    emotions = tuple(manifest["emotions"])
    model = Lds(folder.layout, emotions, windows, settings, features=features, heard=heard, manifest=manifest, **parts)
    stated_s = float(manifest["latency"]["look_ahead_s"])
    if abs(stated_s - model.look_ahead_s) > 1 / windows.rate:
        raise FacesynthError(
            f"{folder.path / MANIFEST} states a look-ahead of {stated_s:g} s, and windows that reach "
            f"{model.look_ahead_s:g} s ahead; export the model again"
        )
    return model


def _require_new(folder: Folder) -> None:
    """FacesynthError for a folder from before noise depended on the speech, and lips were shut: it would move otherwise."""
    if lacking := [name for name in ("noise_amounts", "closed_gap") if name not in folder.settings]:
        raise FacesynthError(
            f"{folder.path / MANIFEST} was exported by an older facesynth: it lacks {' and '.join(lacking)}; wanted one that says"
            " how much noise there is in each state of the speech and how lips shut: export the model again"
        )


def _no_periodogram(**_arrays: Any) -> Any:
    raise FacesynthError("this system hears with a network and no periodogram; let it speak, or stream it")
