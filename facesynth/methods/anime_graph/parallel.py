"""Sentences that were recorded in several emotions, and several times: what emotion maps are learned from."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus import Utterance
from facesynth.inference.anime_graph.audio_cost import warp_path
from facesynth.inference.arrays import Floats
from facesynth.methods.anime_graph.components import FaceComponents

LEAST_FRAMES = 10


@dataclass(frozen=True, eq=False)
class Take:
    """One recording of a sentence."""

    sentence: str
    emotion: str
    take: int
    frames: NDArray[np.float32]
    """[T, C] its complete frames."""
    components: Floats
    """[T, D]"""
    fps: float


def take_of(utterance: Utterance, components: FaceComponents) -> Take | None:
    """The utterance's complete frames, or None where there are hardly any."""
    frames, fps = utterance.motion.frames, utterance.motion.fps
    frames = frames[np.isfinite(frames).all(axis=1)]
    if len(frames) < LEAST_FRAMES:
        return None
    return Take(utterance.sentence, utterance.emotion, utterance.take, frames, components.encode_array(frames), fps)


def emotion_pairs(takes: Iterable[Take], source: str, target: str) -> list[tuple[Take, Take]]:
    """Recordings of one sentence in both emotions: first take with first take, and so on, by sentence."""
    takes = sorted(takes, key=lambda t: (t.sentence, t.take))
    pairs = []
    for sentence in dict.fromkeys(t.sentence for t in takes):
        sources, targets = ([t for t in takes if (t.sentence, t.emotion) == (sentence, e)] for e in (source, target))
        pairs += list(zip(sources, targets, strict=False))
    return pairs


def retakes(takes: Sequence[Take]) -> list[tuple[Take, Take]]:
    """Recordings of one sentence in one emotion."""
    return [(a, b) for a, b in combinations(takes, 2) if (a.sentence, a.emotion) == (b.sentence, b.emotion)]


def aligned(a: Take, b: Take, by: NDArray[np.int64]) -> NDArray[np.int64]:
    """[T] for each frame of take a the frame of take b in which the same is said, by DTW of the components `by`.

    Each component's mean over the take is left out: an emotion that lasts shifts it, speech does not.
    """
    first, second = (t.components[:, by] - t.components[:, by].mean(axis=0) for t in (a, b))
    return np.round(warp_path(first, second)).astype(np.int64)
