"""Known phones found in the phone network's probabilities: the best path through them (CTC Viterbi), by viseme class."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from facesynth.inference.ear import FRAMES_PER_S
from facesynth.inference.phones import VISEME_CLASSES, viseme_of
from facesynth.inference.spikes import INSIDE_S, LAG_S, Alphabet, Spike

NOTHING = 0
"""Class of blanks and marks; no phone that is spoken has it."""
LEAST = -10.0
"""Logarithms of probabilities are not counted as smaller than this: one phone that is not there does not outweigh all others."""

Classes = NDArray[np.float32]


def class_log_probabilities(log_probabilities: NDArray[Any], alphabet: Alphabet) -> Classes:
    """[T, 15] logarithms of the probabilities of viseme classes, of [T, V] those of tokens; NOTHING holds blanks and marks.

    Networks confuse phones that look alike, and what sounds foreign has no token of its own: on a face that matters little, so
    the tokens of a class are added up.
    """
    class_of = np.array([viseme_of(phones[-1]) if phones else NOTHING for phones in alphabet.phones])
    members = np.eye(len(VISEME_CLASSES))[class_of]
    return np.log(np.exp(log_probabilities.astype(np.float64)) @ members + 1e-12).astype(np.float32)


def align_phones(classes: Classes, words: Sequence[Sequence[str]], first_s: float = 0.0) -> list[Spike] | None:
    """Where the phones of words are told in class probabilities [T, 15]; None where there are more phones than frames.

    first_s: middle of the first frame, seconds. Neighbours of one class are one for the path and told one after the other. The
    confidence of a phone is the probability of its class where that is largest on the phone's frames.
    """
    phones = [(phone, not place) for word in words for place, phone in enumerate(word)]
    if not phones:
        return []
    wanted = np.array([viseme_of(phone) for phone, _ in phones])
    starts = np.flatnonzero(np.diff(wanted, prepend=-1))
    if 2 * len(starts) > len(classes):
        return None
    first, last = _frames(classes, wanted[starts])
    best = np.exp([classes[a : b + 1, kind].max() for a, b, kind in zip(first, last, wanted[starts], strict=True)])
    run = np.searchsorted(starts, np.arange(len(phones)), side="right") - 1
    later_s = INSIDE_S * (np.arange(len(phones)) - starts[run])
    return [
        Spike(
            phone,
            first_s + first[k] / FRAMES_PER_S - LAG_S + later,
            first_s + last[k] / FRAMES_PER_S - LAG_S + later,
            float(best[k]),
            begins,
        )
        for (phone, begins), k, later in zip(phones, run, later_s, strict=True)
    ]


# Graves et al. 2006, section 4: between the wanted labels any number of blanks may stand, a label lasts one frame or more, and
# of all such paths the most probable is taken. Wanted are classes, no two neighbours alike, so that no blank need stand anywhere.
# States are blank, label, blank, label, …, blank; a path stays, goes on by one, or from a label to the next past the blank.
def _frames(classes: Classes, wanted: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """First and last frame of each of the wanted classes [N]."""
    told = np.full(2 * len(wanted) + 1, NOTHING)
    told[1::2] = wanted
    emitted = classes[:, told]
    best = np.full(len(told) + 2, -np.inf, np.float32)  # two before the first state, from where nothing comes
    best[2:4] = emitted[0, :2]
    steps = np.zeros(emitted.shape, np.int8)
    leaps = np.where(np.arange(len(told)) % 2, 0, -np.inf).astype(np.float32)
    for frame in range(1, len(classes)):
        ways = np.stack([best[2:], best[1:-1], best[:-2] + leaps])
        steps[frame] = ways.argmax(axis=0)
        best[2:] = ways.max(axis=0) + emitted[frame]
    state = len(told) - 1 if best[-1] >= best[-2] else len(told) - 2
    path = np.empty(len(classes), int)
    for frame in range(len(classes) - 1, -1, -1):
        path[frame] = state
        state -= int(steps[frame, state])
    labels = 2 * np.arange(len(wanted)) + 1
    return np.searchsorted(path, labels), np.searchsorted(path, labels, side="right") - 1


def fit_of(spikes: Sequence[Spike]) -> float:
    """How well phones lie in the sound: mean logarithm of their probabilities, 0 at best, LEAST at worst."""
    return float(np.mean(np.maximum(np.log([spike.confidence for spike in spikes]), LEAST))) if spikes else LEAST
