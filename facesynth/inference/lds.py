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
from .layout import Layout
from .lips import bilabial_spans
from .motion import Motion
from .sound import resample
from .speech_state import STATES, amounts_along
from .windows import FrameWindows

MOST_FRAMES = 1024
"""Frames computed at once: memory does not grow with the sound."""


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
    [1, T, C] and the state after them.
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
        manifest: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        self.layout, self.emotions, self.windows, self.settings = layout, emotions, windows, settings
        self.features, self.innovations, self.rollout = features, innovations, rollout
        self.fps, self.rate, self.manifest = windows.fps, windows.rate, manifest

    @property
    def look_ahead_s(self) -> float:
        """Frame t waits for the sound up to t / fps + this, seconds."""
        return self.windows.look_ahead_s

    def synthesize(self, speech: Any, *, seed: int = 0, noise: float = 1.0, **options: Any) -> Motion:
        """Motion for speech; `noise` 1 as learned, 0 the deterministic part alone.

        The system hears the sound alone. Where phones are given they say how much noise there is, and where lips are shut.
        """
        reject_options("lds", options, ("seed", "noise"))
        count = max(1, int(speech.phones.frame_bounds(self.fps)[-1]))
        audio = resample(checked_audio(speech.audio), speech.sample_rate, self.rate)
        state = replace(self.start(seed=seed, noise=noise), heard=audio)
        frames, _ = self._frames(state, count, amounts_along(self.settings.noise_amounts, speech.phones, self.fps, count))
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
        """More sound [S] at the model's rate: the frames [t, C] that became final, possibly none, and the state after them."""
        state = replace(state, heard=np.concatenate([state.heard, checked_piece(audio)]))
        stops = self.windows.starts(state.frames, self._most(state)) + self.windows.length
        ready = int(np.searchsorted(stops, state.samples, side="right"))
        return self._frames(state, min(state.frames + ready, self._most(state)))

    def finish(self, state: LdsState) -> tuple[NDArray[np.float32], LdsState]:
        """The frames that were held back: after the end there is silence."""
        return self._frames(state, max(1, self._most(state)))

    def stream(self, *, seed: int = 0, noise: float = 1.0, sample_rate: int | None = None) -> "LdsStream":
        """Sound in pieces of any size; `sample_rate` must be the model's."""
        checked_rate(self.rate if sample_rate is None else sample_rate, self.rate)
        return LdsStream(self, self.start(seed=seed, noise=noise))

    def _most(self, state: LdsState) -> int:
        """Frames of the sound so far."""
        return round(state.samples / self.rate * self.fps)

    def _frames(self, state: LdsState, stop: int, amounts: Floats | None = None) -> tuple[NDArray[np.float32], LdsState]:
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
            _, features = self.features(windows=self.windows.cut(state.heard, state.first, first, last)[None])
            drawn = self._draw(rng, last - first, state.noise)
            frames, system = self.rollout(features=features, innovations=drawn, state=system)
            still, plain = self.rollout(features=features, innovations=np.zeros_like(drawn), state=plain)
            amount = np.full(last - first, unknown) if amounts is None else amounts[first:last]
            done.append(still[0] + amount.astype(np.float32)[:, None] * (frames[0] - still[0]))
        stop = max(stop, state.frames)
        kept = int(np.clip(self.windows.starts(stop, stop + 1)[0] - state.first, 0, len(state.heard)))
        heard, first_kept = state.heard[kept:], state.first + kept
        return np.concatenate(done), LdsState(system, plain, heard, first_kept, stop, state.noise, rng.bit_generator.state)

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


def load_lds(folder: Folder, threads: int) -> Lds:
    """The system that an `lds` model was exported to."""
    _require_new(folder)
    manifest, settings = folder.manifest, LdsSettings.from_dict(folder.settings)
    windows = settings.windows(float(manifest["fps"]), int(manifest["sample_rate"]))
    stated_s = float(manifest["latency"]["look_ahead_s"])
    if abs(stated_s - windows.look_ahead_s) > 1 / windows.rate:
        raise FacesynthError(
            f"{folder.path / MANIFEST} states a look-ahead of {stated_s:g} s, and windows that reach "
            f"{windows.look_ahead_s:g} s ahead; export the model again"
        )
    graphs = {name: Graph(folder, name, threads) for name in ("features", "innovations", "rollout")}
    return Lds(folder.layout, tuple(manifest["emotions"]), windows, settings, manifest=manifest, **graphs)


def _require_new(folder: Folder) -> None:
    """FacesynthError for a folder from before noise depended on the speech, and lips were shut: it would move otherwise."""
    if lacking := [name for name in ("noise_amounts", "closed_gap") if name not in folder.settings]:
        raise FacesynthError(
            f"{folder.path / MANIFEST} was exported by an older facesynth: it lacks {' and '.join(lacking)}; wanted one that says"
            " how much noise there is in each state of the speech and how lips shut: export the model again"
        )
