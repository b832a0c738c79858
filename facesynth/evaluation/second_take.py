"""A second recording of the same words and emotion: how near one performer comes to himself."""

from difflib import SequenceMatcher

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus import Corpus, Utterance
from facesynth.inference.motion import Motion
from facesynth.inference.speech import PhoneTrack


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
    here, there = _anchors(phones, theirs)
    at = np.interp(times_s, here, there) * take.motion.fps
    head = None if take.motion.head is None else _sampled(take.motion.head, at)
    return Motion(_sampled(take.motion.frames, at), take.motion.fps, take.motion.layout, head)


def _anchors(phones: PhoneTrack, theirs: PhoneTrack) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times (s) in both tracks at which a common phone starts or ends, with the start and the end of both."""
    runs = SequenceMatcher(None, phones.labels, theirs.labels, autojunk=False).get_matching_blocks()
    pairs = {(0.0, 0.0), (phones.duration_s, theirs.duration_s)}
    for run in runs:
        for i, j in zip(range(run.a, run.a + run.size), range(run.b, run.b + run.size), strict=True):
            pairs |= {(float(phones.starts_s[i]), float(theirs.starts_s[j])), (float(phones.ends_s[i]), float(theirs.ends_s[j]))}
    here, there = np.array(sorted(pairs)).T
    kept = np.diff(here, prepend=-1.0) > 0
    return here[kept], there[kept]


def _sampled(signal: NDArray[np.float32], at: NDArray[np.float64]) -> NDArray[np.float32]:
    """[T', C] the channels of [T, C] at frame positions [T'], linearly, over missing samples too."""
    columns = []
    for column in signal.T:
        present = np.flatnonzero(~np.isnan(column))
        columns.append(np.interp(at, present, column[present]) if present.size else np.full(len(at), np.nan))
    return np.stack(columns, axis=1).astype(np.float32)
