"""From a corpus to clips: what the system is identified from."""

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from facesynth.corpus import Corpus
from facesynth.inference.errors import FacesynthError
from facesynth.inference.sound import resample
from facesynth.progress import track
from facesynth.speech.periodogram import RATE, Periodogram

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
        pieces += [Piece(utterance.sentence, audio, a, frames[a:b]) for a, b in _complete(frames) if b - a >= SHORTEST]
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
