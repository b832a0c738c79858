"""Head motion by hidden Markov models over prosody (Deng 2006, §4.4).

Head rotations are quantised into clusters; each cluster has a model of the prosody that is heard while the head is there. All
models together are one network, whose arcs between models carry the bigram of clusters: the most likely way through it says in
which cluster the head is at each moment (eq. 4.15). Cluster means at six moments a second, a little off at random (eq. 4.18),
are the key points of a spherical cubic (eq. 4.16, 4.17).
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..checks import checked_audio, checked_seed
from ..errors import reject_options
from ..layout import Layout
from ..long_arrays import by_blocks
from ..motion import Motion
from ..pitch import RATE
from ..quaternions import from_angles, squad, to_rotvec
from ..sound import resample
from ..windows import FrameWindows
from .voice import pitch_windows, prosody_of

HEARD_FPS = 60.0
"""Prosody frames a second: windows of 25 ms that overlap by 8.3 ms."""
KEYS_PER_S = 6.0
MOST_WINDOWS = 2048
"""Heard at once."""
LogLikelihood = Callable[..., list[NDArray[Any]]]
"""`prosody` [1, T, 6] to `log_likelihood` [1, T, N] of the states of all models."""


@dataclass(frozen=True, eq=False)
class Network:
    """States of all models, cluster after cluster."""

    log_start: Floats
    """[N] of beginning in each state."""
    log_step: Floats
    """[N, N] of going from one (row) to another, within a model or over the bigram into the next one."""
    clusters: Ints
    """[N] which model each state belongs to."""


def most_likely(network: Network, log_likelihood: NDArray[np.floating[Any]]) -> tuple[float, Ints]:
    """Log probability of the most likely way through the network, and its states [T] (Viterbi)."""
    best = network.log_start + log_likelihood[0]
    before = np.empty((len(log_likelihood), len(best)), np.min_scalar_type(len(best)))
    columns = np.arange(len(best))
    for t in range(1, len(log_likelihood)):
        arrive = best[:, None] + network.log_step
        before[t] = arrive.argmax(axis=0)
        best = arrive[before[t], columns] + log_likelihood[t]
    states = np.empty(len(log_likelihood), np.int64)
    states[-1] = best.argmax()
    for t in range(len(states) - 1, 0, -1):
        states[t - 1] = before[t, states[t]]
    return float(best.max()), states


def curve_through(angles: Floats, spread: Floats, count: int, fps: float, rng: np.random.Generator) -> Floats:
    """[count, 3] rotation vectors through angles [T, 3] (pitch, yaw, roll in rad, HEARD_FPS), at `fps`.

    spread: [T, 3] largest deviation of a key point. Random numbers move key points and not frames, which would tremble.
    """
    ends_s = max(count - 1, 1) / fps
    times_s = np.arange(int(np.ceil(ends_s * KEYS_PER_S)) + 1) / KEYS_PER_S
    at = np.minimum(np.round(times_s * HEARD_FPS).astype(np.int64), len(angles) - 1)
    keys = angles[at] + spread[at] * rng.uniform(-1, 1, (len(at), 3))
    return to_rotvec(squad(from_angles(keys), np.arange(count) / fps * KEYS_PER_S))


@dataclass(frozen=True, eq=False)
class HeadHmm:
    """A trained model; its face stays at rest, its head turns."""

    layout: Layout
    frame: NDArray[np.float32]
    """[C] the face at rest."""
    fps: float
    emotions: tuple[str, ...]
    network: Network
    means: Floats
    """[K, 3] pitch, yaw and roll of each cluster (rad)."""
    spreads: Floats
    """[K, 3] largest random deviation from it (rad)."""
    log_likelihood: LogLikelihood
    manifest: dict[str, Any] = field(default_factory=dict)

    @cached_property
    def windows(self) -> FrameWindows:
        """Of the sound, centred on the prosody frames."""
        return pitch_windows(HEARD_FPS)

    @property
    def rate(self) -> int:
        """Hz of the sound that it listens to."""
        return RATE

    def synthesize(self, speech: Any, *, seed: int = 0, **options: Any) -> Motion:
        """Head motion for speech, of which only the sound counts."""
        reject_options("head_hmm", options, ("seed",))
        count = max(1, int(speech.phones.frame_bounds(self.fps)[-1]))
        audio = resample(checked_audio(speech.audio), speech.sample_rate, RATE)
        clusters = self.clusters(audio, max(1, round(count / self.fps * HEARD_FPS)))
        rng = np.random.default_rng(checked_seed(seed))
        turns = curve_through(self.means[clusters], self.spreads[clusters], count, self.fps, rng)
        head = np.concatenate([turns, np.zeros((count, 3))], axis=1).astype(np.float32)
        return Motion(np.tile(self.frame, (count, 1)), self.fps, self.layout, head)

    def clusters(self, audio: NDArray[np.float32], count: int) -> Ints:
        """[T] the cluster that the head is in, at `count` moments of sound [S] at RATE."""
        bounds = pairwise([*range(0, count, MOST_WINDOWS), count])
        pieces = (self.windows.cut(audio, 0, first, stop).astype(np.float64) for first, stop in bounds)
        prosody = prosody_of(pieces, HEARD_FPS)
        heard = by_blocks(lambda some: self.log_likelihood(prosody=some[None])[0][0], prosody.astype(np.float32))
        return self.network.clusters[most_likely(self.network, heard)[1]]
