"""From a corpus to clips: what the system is identified from."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from facesynth.corpus import Corpus
from facesynth.inference.arrays import Ints
from facesynth.inference.errors import FacesynthError
from facesynth.inference.lips import bilabial_spans, narrowest_gaps
from facesynth.inference.sound import resample
from facesynth.inference.speech_state import frame_states
from facesynth.motion.pca import Pca
from facesynth.progress import track
from facesynth.speech.periodogram import RATE, Periodogram


class Standardised(nn.Module):
    """Principal components, each divided by its standard deviation and held to the range it was seen in."""

    scale: Tensor
    """[D] standard deviation of each component."""
    low: Tensor
    """[D] least value seen, in standard deviations."""
    high: Tensor
    """[D] largest value seen."""

    def __init__(self, pca: Pca, scale: Tensor, low: Tensor, high: Tensor) -> None:
        super().__init__()
        self.pca = pca
        self.register_buffer("scale", scale)
        self.register_buffer("low", low)
        self.register_buffer("high", high)

    @classmethod
    def empty(cls) -> Self:
        """One without content, for `load` to fill."""
        nothing = torch.zeros(0)
        return cls(Pca(nothing, nothing, nothing), nothing, nothing, nothing)

    @classmethod
    def fit(cls, frames: Sequence[NDArray[Any]], components: float, what: str) -> Self:
        """Learn from clips of frames [T, C]; FacesynthError where they are constant."""
        stacked = np.concatenate(frames)
        require_change(stacked, what)
        pca = Pca.fit(stacked, components)
        encoded = pca.encode(torch.from_numpy(stacked).float())
        moving = encoded.std(dim=0) > 1e-6 * encoded.std(dim=0).max()
        pca = Pca(pca.mean, pca.basis[:, moving], pca.variance_ratio[moving])
        encoded = encoded[:, moving]
        scale = encoded.std(dim=0)
        return cls(pca, scale, encoded.amin(dim=0) / scale, encoded.amax(dim=0) / scale)

    def encode(self, frames: Tensor) -> Tensor:
        """Frames [T, C] to components [T, D] of about unit variance.

        Held to the range seen in training: a linear system would follow sound that it never heard, such as digital
        silence, anywhere.
        """
        return torch.clamp(self.pca.encode(frames) / self.scale, self.low, self.high)

    def decode(self, components: Tensor) -> Tensor:
        """Components [T, D] to frames [T, C]."""
        return self.pca.decode(components * self.scale)


def require_change(frames: NDArray[Any], what: str) -> None:
    """FacesynthError where frames [N, C] are all the same."""
    if np.ptp(frames, axis=0).max() <= 1e-9 * max(1.0, float(np.abs(frames).max())):
        raise FacesynthError(f"{what} is the same in all {len(frames)} frames: there is nothing to learn; check the recording")


SHORTEST = 20
"""Frames: shorter pieces between gaps teach nothing."""


@dataclass(frozen=True, eq=False)
class Piece:
    """An uninterrupted stretch of one utterance."""

    sentence: str
    audio: NDArray[np.float32]
    """[S] the whole utterance's sound at 16 kHz."""
    first: int
    """Frame of the utterance at which the piece begins."""
    frames: NDArray[np.float32]
    """[T, C] complete frames."""
    states: Ints
    """[T] what the mouth is busy with, see `inference.speech_state`."""
    gaps: Sequence[float]
    """How near the lips came at each p, b or m of the utterance."""

    @property
    def stop(self) -> int:
        """One past the last frame, counted in the utterance."""
        return self.first + len(self.frames)


def pieces_of(corpus: Corpus) -> tuple[list[Piece], int]:
    """The complete stretches of all utterances, and how many frames were left out for gaps."""
    pieces: list[Piece] = []
    total = 0
    for utterance in track(corpus, "reading", total=len(corpus)):
        audio = resample(utterance.speech.audio, utterance.speech.sample_rate, RATE)
        frames = utterance.motion.frames
        total += len(frames)
        states = frame_states(utterance.speech.phones, utterance.motion.fps, len(frames))
        spans = bilabial_spans(utterance.speech.phones, utterance.motion.fps)
        gaps = narrowest_gaps(frames, corpus.layout, spans)
        whole = [(a, b) for a, b in _complete(frames) if b - a >= SHORTEST]
        pieces += [Piece(utterance.sentence, audio, a, frames[a:b], states[a:b], gaps) for a, b in whole]
    if not pieces:
        raise FacesynthError(f"no utterance of the corpus has {SHORTEST} complete frames in a row; check it with `corpus check`")
    return pieces, total - sum(len(piece.frames) for piece in pieces)


def periodograms(pieces: list[Piece], periodogram: Periodogram) -> list[NDArray[np.float32]]:
    """[T, 256] for each piece."""
    return [periodogram(torch.from_numpy(piece.audio), piece.stop)[piece.first :].numpy() for piece in pieces]


def _complete(frames: NDArray[np.float32]) -> list[tuple[int, int]]:
    """Stretches without NaN, as (first frame, one past the last)."""
    good = np.concatenate([[False], np.isfinite(frames).all(axis=1), [False]]).astype(np.int8)
    edges = np.diff(good)
    return list(zip(np.flatnonzero(edges == 1).tolist(), np.flatnonzero(edges == -1).tolist(), strict=True))
