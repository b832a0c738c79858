"""A second recording of the same words and emotion: how near one performer comes to himself."""

from collections.abc import Sequence
from difflib import SequenceMatcher

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus import Corpus, Utterance
from facesynth.inference.motion import Motion
from facesynth.inference.speech import PhoneTrack

Span = tuple[str, float, float]
"""Label, start and end (s)."""


def second_take(corpus: Corpus, utterance_id: str) -> Utterance | None:
    """Another usable recording of the same sentence and emotion, the one of the lowest take; None where there is none."""
    this = corpus.record(utterance_id)
    wanted = (this.sentence_key, this.emotion)
    others = [r for r in corpus.usable_records if (r.sentence_key, r.emotion) == wanted and r.id != this.id]
    return corpus[min(others, key=lambda r: (r.take, r.id)).id] if others else None


def retimed(take: Utterance, phones: PhoneTrack) -> Motion:
    """The motion of a take in the timing of other phones, at its own rate, missing samples bridged.

    Time runs linearly between the ends of the phones that both have (longest common runs of labels).
    """
    theirs = take.speech.phones
    times_s = np.arange(phones.frame_bounds(take.motion.fps)[-1]) / take.motion.fps
    here, there = matching_times(spans(phones), spans(theirs))
    at = np.interp(times_s, here, there) * take.motion.fps
    head = None if take.motion.head is None else sampled(take.motion.head, at)
    return Motion(sampled(take.motion.frames, at), take.motion.fps, take.motion.layout, head)


def spans(phones: PhoneTrack) -> list[Span]:
    """Label, start and end (s) of each phone."""
    return list(zip(phones.labels, phones.starts_s.tolist(), phones.ends_s.tolist(), strict=True))


def matching_times(phones: Sequence[Span], theirs: Sequence[Span]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times (s) in both at which a common phone starts or ends, with the start and the end of both."""
    mine, others = ([label for label, _, _ in some] for some in (phones, theirs))
    runs = SequenceMatcher(None, mine, others, autojunk=False).get_matching_blocks()
    pairs = {(phones[0][1], theirs[0][1]), (phones[-1][2], theirs[-1][2])}
    for run in runs:
        for i, j in zip(range(run.a, run.a + run.size), range(run.b, run.b + run.size), strict=True):
            pairs |= {(phones[i][1], theirs[j][1]), (phones[i][2], theirs[j][2])}
    here, there = np.array(sorted(pairs)).T
    kept = np.diff(here, prepend=-np.inf) > 0
    return here[kept], there[kept]


def sampled(signal: NDArray[np.float32], at: NDArray[np.float64]) -> NDArray[np.float32]:
    """[T', C] the channels of [T, C] at frame positions [T'], linearly, over missing samples too."""
    columns = []
    for column in signal.T:
        present = np.flatnonzero(~np.isnan(column))
        columns.append(np.interp(at, present, column[present]) if present.size else np.full(len(at), np.nan))
    return np.stack(columns, axis=1).astype(np.float32)
