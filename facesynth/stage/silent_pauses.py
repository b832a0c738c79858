"""Long pauses made silent for models that listen: lips rest while nobody speaks, whatever else is heard.

A model that is driven by sound moves to music, laughter and noise as to a voice, wherever they are loud. Where the phones say
that nobody speaks for a while, such models are given silence; videos keep the sound as it is. Near speech a pause keeps its
sound, since lips part with the breath before the first word.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.long_arrays import joined, row_blocks
from facesynth.inference.phones import SILENCE
from facesynth.inference.speech import PhoneTrack, Speech

PAUSE_S = 0.8
"""Shorter pauses are part of speaking."""
BESIDE_S = 0.15
"""Of a long pause so much beside speech keeps its sound: with the reach of such models lips rest within 0.3 s."""
FADE_S = 0.03

Pauses = tuple[tuple[float, float], ...]


@dataclass
class SilentPauses:
    """Makes long pauses silent, and remembers the last sound: models know again what they have heard."""

    _audio: NDArray[np.float32] | None = None
    _pauses: Pauses = ()
    _silent: NDArray[np.float32] | None = None

    def of(self, speech: Speech) -> Speech:
        """Speech whose sound is silent in long pauses; itself where there is none, or nobody speaks at all."""
        pauses = tuple(long_pauses(speech.phones))
        if not pauses or set(speech.phones.labels) == {SILENCE}:
            return speech
        if self._audio is not speech.audio or self._pauses != pauses or self._silent is None:
            self._audio, self._pauses = speech.audio, pauses
            self._silent = silenced(speech.audio, speech.sample_rate, pauses)
        return replace(speech, audio=self._silent)


def long_pauses(phones: PhoneTrack) -> Iterator[tuple[float, float]]:
    """Start and end in seconds of what is to be silent: of each long pause what is not beside speech."""
    ends_s = [0.0, *map(float, phones.ends_s)]
    spoken = [number for number, label in enumerate(phones.labels) if label != SILENCE]
    edges = [(0.0, -BESIDE_S), *((ends_s[number], ends_s[number + 1]) for number in spoken), (ends_s[-1] + BESIDE_S, 0.0)]
    for (_, before_s), (after_s, _) in pairwise(edges):
        if after_s - before_s >= PAUSE_S:
            yield before_s + BESIDE_S, after_s - BESIDE_S


def silenced(audio: NDArray[np.float32], rate: int, pauses: Pauses) -> NDArray[np.float32]:
    """A sound [S] without what lies in the pauses, faded out and in."""
    edges_s = np.array([(start_s, start_s + FADE_S, stop_s - FADE_S, stop_s) for start_s, stop_s in pauses]).ravel()
    gains = np.tile([1.0, 0.0, 0.0, 1.0], len(pauses))

    def blocks() -> Iterator[NDArray[np.float32]]:
        for rows in row_blocks(audio):
            gain = np.interp(np.arange(rows.start, rows.stop) / rate, edges_s, gains)
            yield (audio[rows] * gain).astype(np.float32)

    return joined(blocks())
