"""Head motion from the nearest recorded movements (Deng 2006, §4.3), for a whole sound or as it comes in."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Floats, Ints
from ..checks import checked_audio, checked_piece, checked_rate, require_open
from ..errors import FacesynthError, reject_options
from ..layout import Layout
from ..motion import Motion
from ..pitch import RATE
from ..sound import resample
from ..windows import FrameWindows
from .keys import HeadKeys
from .neighbours import Neighbours
from .search import Candidates, PathSearch, Scales, best_paths, poses_along
from .voice import pitch_windows, voice_features

MOST_FRAMES = 4096
"""Heard at once."""
Project = Callable[..., list[NDArray[Any]]]
"""`features` [1, T, 31] to `coefficients` [1, T, D]: principal components, in standard deviations (eq. 4.1)."""


@dataclass(frozen=True, eq=False)
class Recorded:
    """The audio-headmotion database."""

    coefficients: Floats
    """[N, D] of the sound around each frame."""
    moves: Floats
    """[N, 6] relative poses: to this frame from the one before."""
    rest: Floats
    """[6] mean pose; a head begins there and is drawn to it where there is no key pose."""
    scales: Scales
    pitch_hz: float
    """Usual pitch, held until one is heard."""


@dataclass(frozen=True)
class KnnSettings:
    """Numbers of the search."""

    neighbours: int
    """K."""
    weights: tuple[float, float, float]
    """Wn, Wr, Wa."""
    beam: int
    """Paths kept for each candidate."""


@dataclass(frozen=True, eq=False)
class HeadKnn:
    """A trained model; its face stays at rest, its head moves."""

    layout: Layout
    frame: NDArray[np.float32]
    """[C] the face at rest."""
    fps: float
    emotions: tuple[str, ...]
    settings: KnnSettings
    recorded: Recorded
    project: Project
    manifest: dict[str, Any] = field(default_factory=dict)

    @cached_property
    def neighbours(self) -> Neighbours:
        """Of the recorded sound."""
        return Neighbours(self.recorded.coefficients)

    @cached_property
    def windows(self) -> FrameWindows:
        """Of the sound, centred on the frames."""
        return pitch_windows(self.fps)

    @property
    def rate(self) -> int:
        """Hz of the sound that it listens to."""
        return RATE

    def synthesize(self, speech: Any, *, seed: int = 0, head_keys: HeadKeys | None = None, **options: Any) -> Motion:
        """Head motion for speech, of which only the sound counts; nothing is random."""
        reject_options("head_knn", options, ("seed", "head_keys"))
        count = max(1, int(speech.phones.frame_bounds(self.fps)[-1]))
        head = self.head(resample(checked_audio(speech.audio), speech.sample_rate, RATE), count, head_keys or HeadKeys.none())
        return Motion(np.tile(self.frame, (count, 1)), self.fps, self.layout, head.astype(np.float32))

    def head(self, audio: NDArray[np.float32], count: int, keys: HeadKeys) -> Floats:
        """[T, 6] poses for `count` frames of sound [S] at RATE."""
        require_within(keys, count, self.fps)
        found = self.candidates(audio, count, keys)
        start = self.start(keys)
        _, chosen = best_paths(found, self._weights, start, self.recorded.scales, self.settings.beam)
        return poses_along(found, chosen[0], start)

    def candidates(self, audio: NDArray[np.float32], count: int, keys: HeadKeys) -> Candidates:
        """The nearest recorded movements for each frame."""
        distances, index = self.near(audio, count)
        return Candidates(distances, self.recorded.moves[index], *keys.targets(0, count, self.fps, self.recorded.rest))

    def near(self, audio: NDArray[np.float32], count: int) -> tuple[Floats, Ints]:
        """Distances and numbers [T, K] of the nearest recorded frames."""
        pitch_hz, found = self.recorded.pitch_hz, []
        for first in range(0, count, MOST_FRAMES):
            piece = self.windows.cut(audio, 0, first, min(first + MOST_FRAMES, count))
            features, pitch_hz = voice_features(piece.astype(np.float64), pitch_hz)
            found.append(self._nearest(features))
        return np.concatenate([d for d, _ in found]), np.concatenate([i for _, i in found])

    def start(self, keys: HeadKeys) -> Floats:
        """[6] the pose before the first frame: a key pose at time 0, or rest."""
        return keys.poses[0] if len(keys.times_s) and keys.times_s[0] == 0 else self.recorded.rest

    def stream(
        self, *, look_ahead_s: float = 0.25, keys: HeadKeys | None = None, sample_rate: int | None = None
    ) -> "HeadKnnStream":
        """Sound in pieces: a pose is final when the search has seen `look_ahead_s` more; endless, it is `head` of the whole."""
        checked_rate(RATE if sample_rate is None else sample_rate, RATE)
        if not look_ahead_s >= 0:
            raise FacesynthError(f"look_ahead_s is {look_ahead_s}; wanted 0 or more")
        return HeadKnnStream(self, look_ahead_s, keys or HeadKeys.none())

    def _nearest(self, features: Floats) -> tuple[Floats, Ints]:
        (coefficients,) = self.project(features=features.astype(np.float32)[None])
        return self.neighbours.nearest(coefficients[0].astype(np.float64), self.settings.neighbours)

    @property
    def _weights(self) -> Floats:
        return np.array([self.settings.weights])


class HeadKnnStream:
    """`push` sound, get poses."""

    def __init__(self, model: HeadKnn, look_ahead_s: float, keys: HeadKeys) -> None:
        self._model, self._keys = model, keys
        self._wait = look_ahead_s * model.fps
        self._pose = model.start(keys)
        self._search = PathSearch(model._weights, self._pose, model.recorded.scales, model.settings.beam)
        self._sound, self._at, self._samples = np.zeros(0, np.float32), 0, 0
        self._pitch_hz = model.recorded.pitch_hz
        self._before: list[Ints] = []
        self._moves: list[Floats] = []
        """Of the frames that are not final yet."""
        self._ended = False

    def push(self, audio: ArrayLike) -> Floats:
        """More sound [S] at RATE; the poses [t, 6] that became final."""
        require_open(self._ended)
        piece = checked_piece(audio)
        self._sound, self._samples = np.concatenate([self._sound, piece]), self._samples + len(piece)
        most = round(self._samples / RATE * self._model.fps)
        stops = self._model.windows.starts(self._search.frames, most) + self._model.windows.length
        return self._hear(self._search.frames + int(np.searchsorted(stops, self._samples, side="right")))

    def finish(self) -> Floats:
        """The poses that were held back: after the end there is silence."""
        require_open(self._ended)
        self._ended = True
        heard = self._hear(max(1, round(self._samples / RATE * self._model.fps)))
        left = self._trace()
        self._moves, self._before = [], []
        return np.concatenate([heard, self._follow(left)])

    def _hear(self, stop: int) -> Floats:
        """Search on up to a frame."""
        first = self._search.frames
        if stop <= first:
            return np.zeros((0, 6))
        piece = self._model.windows.cut(self._sound, self._at, first, stop)
        features, self._pitch_hz = voice_features(piece.astype(np.float64), self._pitch_hz)
        distances, index = self._model._nearest(features)
        targets, keyed = self._keys.targets(first, stop, self._model.fps, self._model.recorded.rest)
        final = []
        for k in range(stop - first):
            moves = self._model.recorded.moves[index[k]]
            self._before.append(self._search.step(distances[k], moves, targets[k], bool(keyed[k]))[0])
            self._moves.append(moves)
            if len(self._moves) > self._wait:
                final.append(self._settle())
        keep = max(0, int(self._model.windows.starts(stop, stop + 1)[0]) - self._at)
        self._sound, self._at = self._sound[keep:], self._at + min(keep, len(self._sound))
        return self._follow(np.array(final).reshape(-1, 6))

    def _settle(self) -> Floats:
        """The oldest movement on the best path becomes final; paths that had begun otherwise are given up."""
        number = len(self._moves[0])
        origin = np.arange(len(self._search.costs[0]))
        for before in reversed(self._before[1:]):
            origin = before[origin]
        best = origin[int(self._search.costs[0].argmin())]
        self._search.give_up((origin != best)[None])
        del self._before[0]
        return self._moves.pop(0)[best % number]

    def _trace(self) -> Floats:
        """[n, 6] movements of the best path, from the frames that are not final."""
        at, chosen = int(self._search.costs[0].argmin()), []
        for moves, before in zip(reversed(self._moves), reversed(self._before), strict=True):
            chosen.append(moves[at % len(moves)])
            at = int(before[at])
        return np.array(chosen[::-1]).reshape(-1, 6)

    def _follow(self, moves: Floats) -> Floats:
        """[n, 6] poses after movements."""
        poses = self._pose + np.cumsum(moves, axis=0)
        if len(poses):
            self._pose = poses[-1]
        return poses


def require_within(keys: HeadKeys, count: int, fps: float) -> None:
    """FacesynthError for key poses beyond the end."""
    if len(keys.times_s) and round(keys.times_s[-1] * fps) > count:
        raise FacesynthError(f"a key pose lies at {keys.times_s[-1]:g} s; the speech ends at {count / fps:.3f} s")
