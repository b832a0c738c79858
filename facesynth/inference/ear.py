"""Sound heard by the phone network in overlapping windows: the same answer for the whole and for pieces of any size."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .checks import checked_audio, checked_piece
from .errors import FacesynthError
from .graphs import Part
from .long_arrays import let_go, loudest

RATE = 16000
"""Of the sound, Hz."""
STEP = 320
"""Samples between frames of the network; frame t is centred on sample STEP · t."""
FRAMES_PER_S = RATE / STEP
SHORTEST = 800
"""Samples; a shorter sound is completed with silence."""
PEAK, SMALLEST_PEAK = 0.5, 1e-3
"""The network is given sound of this peak: it hears other phones in sound that is 40 dB quieter. What is quieter than the
second is not raised further."""

Single = NDArray[np.float32]


@dataclass(frozen=True)
class Reach:
    """How much of the sound is looked at for how many frames."""

    block: int
    """Frames that come out of one window."""
    before: int
    """Frames of the window before them."""
    ahead: int
    """Frames of the window after them."""

    @classmethod
    def seconds(cls, block_s: float, before_s: float, ahead_s: float) -> "Reach":
        """Of lengths in seconds, to the next frame; FacesynthError where a block has no frame or a length is negative."""
        block, before, ahead = (round(length * FRAMES_PER_S) for length in (block_s, before_s, ahead_s))
        if block < 1 or before < 1 or ahead < 0:
            raise FacesynthError(
                f"the ear needs a block and a past of at least {1 / FRAMES_PER_S:g} s and a look-ahead that is not negative;"
                f" got {block_s:g}, {before_s:g} and {ahead_s:g} s"
            )
        return cls(block, before, ahead)

    @property
    def look_ahead_s(self) -> float:
        """The first frame of a block waits for this much sound after its middle, the last for `block` less, seconds."""
        return (self.block + self.ahead) / FRAMES_PER_S


WHOLE = Reach.seconds(10.0, 1.0, 1.0)
"""For sound that is there as a whole: windows of 12 s, which the network was made for."""
STREAM_BLOCK_S, STREAM_PAST_S = 0.2, 4.0
"""Of a stream: frames come out this often, and the network looks back this far, seconds."""


def stream_reach(ahead_s: float) -> Reach:
    """Of a stream whose windows reach so far beyond their block, seconds."""
    return Reach.seconds(STREAM_BLOCK_S, STREAM_PAST_S, ahead_s)


@dataclass(frozen=True, eq=False)
class EarState:
    """All that is remembered between two pieces of sound."""

    heard: Single
    """[S'] the sound that later windows need."""
    first: int
    """Which frame `heard` begins with."""
    frames: int
    """How many frames were given out."""
    peak: float
    """Loudest sample so far."""

    @property
    def samples(self) -> int:
        """How many samples were fed."""
        return self.first * STEP + len(self.heard)


@dataclass(frozen=True, eq=False)
class Ear:
    """The network with its windows.

    `network(audio=[1, S])` gives log-probabilities [1, T, V] and hidden layers [1, T, L, W], T = 1 + S // STEP: a graph of a
    folder or a module of torch.
    """

    network: Part
    reach: Reach = WHOLE

    def hear(self, audio: ArrayLike) -> tuple[Single, Single]:
        """Log-probabilities [T, V] and hidden layers [T, L, W] of a whole sound [S] at RATE, all of it brought to one peak."""
        blocks = list(self._of_whole(audio))
        return np.concatenate([b.log_probabilities for b in blocks]), np.concatenate([b.hidden for b in blocks])

    def read(self, audio: ArrayLike) -> Iterator[Single]:
        """Log-probabilities [t, V] of a whole sound [S], window by window: what was read need not be kept."""
        return (block.log_probabilities for block in self._of_whole(audio))

    def read_with_layers(self, audio: ArrayLike) -> Iterator[tuple[Single, Single]]:
        """The same with the hidden layers [t, L, W] of each window."""
        return ((block.log_probabilities, block.hidden) for block in self._of_whole(audio))

    def _of_whole(self, audio: ArrayLike) -> "Iterator[Block]":
        sound = checked_audio(audio)
        state = replace(self.start(), heard=_long_enough(sound), peak=loudest(sound))
        return self._blocks(state, ended=True)

    def start(self) -> EarState:
        """Before the first sample."""
        return EarState(np.zeros(0, np.float32), 0, 0, 0.0)

    def advance(self, state: EarState, audio: ArrayLike, *, ended: bool = False) -> "tuple[list[Block], EarState]":
        """More sound [S] at RATE: each block that became final, and the state after them.

        `ended`: nothing comes after this sound.
        """
        state = replace(state, heard=np.concatenate([state.heard, checked_piece(audio)]))
        if ended and not state.first:
            state = replace(state, heard=_long_enough(state.heard))
        found = list(self._blocks(state, ended))
        return found, found[-1].after if found else state

    def _blocks(self, state: EarState, ended: bool) -> "Iterator[Block]":
        """All blocks whose windows lie within the sound that is known; at its end the last windows are shorter."""
        reach, total = self.reach, state.samples
        count = total // STEP + 1
        while True:
            end = (state.frames + reach.block + reach.ahead) * STEP
            if state.frames >= count or (end > total and not ended):
                return
            block = self._block(state, min(end, total), min(state.frames + reach.block, count))
            yield block
            state = block.after

    def _block(self, state: EarState, end: int, stop: int) -> "Block":
        """Frames up to `stop` from the sound up to sample `end`."""
        begin = max(0, state.frames - self.reach.before)
        window = state.heard[(begin - state.first) * STEP : end - state.first * STEP]
        peak = max(state.peak, float(np.abs(window).max()))
        log_probabilities, hidden = self.network(audio=(window * np.float32(PEAK / max(peak, SMALLEST_PEAK)))[None])
        rows = slice(state.frames - begin, stop - begin)
        let_go(state.heard)
        kept = max(state.first, stop - self.reach.before)
        after = EarState(state.heard[(kept - state.first) * STEP :], kept, stop, peak)
        return Block(log_probabilities[0, rows], hidden[0, rows], after)


class Block(NamedTuple):
    """Frames that came out of one window."""

    log_probabilities: Single
    """[t, V]"""
    hidden: Single
    """[t, L, W]"""
    after: EarState
    """The state after them."""


def _long_enough(sound: Single) -> Single:
    return sound if len(sound) >= SHORTEST else np.pad(sound, (0, SHORTEST - len(sound)))
