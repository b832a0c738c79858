"""Whether what is heard is speech, or music and noise that the phone network hears phones in.

The network was made to hear phones and finds them in a tune, too, at times as surely as in speech. Its layers hold more than the
phones: a logistic regression on the mean of all of them over 0.22 s tells a voice from instruments, whoever speaks and whatever
plays. `train/speech_or_music.py` learned its weights; tables of what it was tried on are in docs/capture.md.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .ear import FRAMES_PER_S
from .spikes import Spike

Single = NDArray[np.float32]
AROUND = 5
"""Frames before and after one, over which the layers are averaged."""
LARGEST = 6.0
"""Log odds that count: beyond, one phone shall not outweigh many."""
SWITCHING = 8.0
"""Log odds that a change from speech to music or back costs. Music between two sentences must be worth two of them."""


@dataclass(frozen=True, eq=False)
class SpeechOrMusic:
    """The regression."""

    weights: Single
    """[L · W] of the layers, one after the other."""
    bias: float

    def log_odds(self, hidden: Single) -> Single:
        """[T] that a frame of the layers' outputs [T, L, W] is speech, by itself."""
        return np.asarray(hidden.reshape(len(hidden), -1) @ self.weights + np.float32(self.bias), np.float32)


def smoothed(rows: Single) -> Single:
    """Rows [T, C], each the mean of those up to AROUND frames away."""
    sums = np.concatenate([np.zeros((1, rows.shape[1])), np.cumsum(rows, axis=0, dtype=np.float64)])
    first = np.maximum(np.arange(len(rows)) - AROUND, 0)
    stop = np.minimum(np.arange(len(rows)) + AROUND + 1, len(rows))
    return ((sums[stop] - sums[first]) / (stop - first)[:, None]).astype(np.float32)


def log_odds_at(found: Sequence[Spike], log_odds: Single) -> Single:
    """Of phones, by the log odds of frames [T]."""
    means = smoothed(log_odds[:, None])[:, 0]
    frames = np.round([(spike.first_s + spike.last_s) / 2 * FRAMES_PER_S for spike in found]).astype(int)
    return means[np.clip(frames, 0, len(means) - 1)]


# Viterbi (1967) with two states. Each phone is worth its log odds to speech and the opposite to music, a change costs the same in
# either direction; the likeliest sequence is read backwards.
def is_speech(log_odds: Single) -> NDArray[np.bool_]:
    """[N] whether each of the phones in order of time is speech, by its log odds [N] and those of its neighbours."""
    gains = np.clip(np.asarray(log_odds, np.float64), -LARGEST, LARGEST)[:, None] * [-0.5, 0.5]
    best, came_from = np.zeros(2), np.zeros((len(gains), 2), int)
    for number, gain in enumerate(gains):
        changed = best[::-1] - SWITCHING
        came_from[number] = np.where(best >= changed, [0, 1], [1, 0])
        best = np.maximum(best, changed) + gain
    state, states = int(best.argmax()), np.zeros(len(gains), bool)
    for number in reversed(range(len(gains))):
        states[number] = state
        state = int(came_from[number, state])
    return states
