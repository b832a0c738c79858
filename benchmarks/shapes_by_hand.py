"""Lips of a real talker, said by key shapes made by hand and by eFASE of the built-in performer: no recording of that talker.

python benchmarks/shapes_by_hand.py TALKER/ PERFORMER/ [clips]

Openings of the built-in head against the recorded ones: correlation, time between extremes (ms), shift (ms), and the share of
p, b and m (open vowels) at which the lips are shut: within the share of a face's own range of openings that nine tenths of the
talker's p, b and m stay in.
"""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus import Corpus, Utterance
from facesynth.evaluation.lips import closure_rate, closure_threshold, false_closure_rate, lip_gap_corr, lip_opening
from facesynth.evaluation.pair import UnavailableError
from facesynth.evaluation.timing import lip_extrema_lag, lip_lag
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.methods.coarticulation.by_hand import from_table
from facesynth.methods.method import Method
from facesynth.methods.registry import create
from facesynth.motion.resample import resample

CLIPS = 60
LIPS = Layout("markers", ("upper", "lower"), lip_pairs=((0, 1),))


def main(talker: Path, performer: Path, clips: int = CLIPS) -> None:
    corpus = Corpus.open(talker)
    said = [corpus[name] for name in corpus.ids[:: max(1, len(corpus) // clips)][:clips]]
    truth = [lips_of(lip_opening(u.motion), u.motion.fps) for u in said]
    shut = share_shut(truth, said)
    print(f"{corpus.performer}: {len(said)} clips; shut up to {shut:.2f} of the range of openings")
    print(f"{'':36s} {'corr':>6s} {'extremes':>9s} {'shift':>6s} {'shut pbm':>9s} {'shut vowels':>12s}")
    told("recorded", truth, truth, said, shut)
    told("shapes by hand", spoken(from_table("arkit", {}), said), truth, said, shut)
    told("phone mean of the performer", spoken(create("phone_mean").fit(Corpus.open(performer)), said), truth, said, shut)
    told("eFASE of the performer", spoken(create("efase").fit(Corpus.open(performer)), said), truth, said, shut)


def share_shut(truth: list[Motion], said: list[Utterance]) -> float:
    """Of the range of openings: where nine tenths of the talker's p, b and m are."""
    narrow, wide = openings(truth)
    threshold = closure_threshold((motion, u.speech.phones) for motion, u in zip(truth, said, strict=True))
    return (threshold - narrow) / (wide - narrow)


def openings(motions: list[Motion]) -> tuple[float, float]:
    """A narrow and a wide one of all."""
    narrow, wide = np.percentile(np.concatenate([lip_opening(motion) for motion in motions]), [1, 95])
    return float(narrow), float(wide)


def spoken(model: Method, said: list[Utterance]) -> list[Motion]:
    """What a model does with the lips, at the clips' rate and length."""
    made = []
    for utterance in said:
        motion = model.synthesize(utterance.speech)
        there = resample(lips_of(lip_opening(motion), motion.fps), utterance.motion.fps)
        at = np.minimum(np.arange(len(utterance.motion)), len(there) - 1)
        made.append(Motion(there.frames[at], utterance.motion.fps, LIPS))
    return made


def lips_of(opening: NDArray[np.float64], fps: float) -> Motion:
    """An opening [T] as two points, one above the other; what is missing is bridged."""
    frames, there = np.zeros((len(opening), 6), np.float32), np.flatnonzero(np.isfinite(opening))
    frames[:, 1] = np.interp(np.arange(len(opening)), there, opening[there])
    return Motion(frames, fps, LIPS)


def told(name: str, made: list[Motion], truth: list[Motion], said: list[Utterance], share: float) -> None:
    narrow, wide = openings(made)
    rows = [_row(*one, narrow + share * (wide - narrow)) for one in zip(made, truth, said, strict=True)]
    corr, extremes, shift, closed, falsely = np.nanmean(rows, axis=0)
    print(f"{name:36s} {corr:6.3f} {extremes:9.1f} {shift:6.1f} {closed:9.2f} {falsely:12.2f}")


def _row(made: Motion, truth: Motion, utterance: Utterance, shut: float) -> list[float]:
    phones = utterance.speech.phones
    pair, alone = (made, truth), (made, phones, shut)
    return [
        _or_nothing(lambda: lip_gap_corr(*pair)),
        _or_nothing(lambda: lip_extrema_lag(*pair)),
        _or_nothing(lambda: abs(lip_lag(*pair))),
        _or_nothing(lambda: closure_rate(*alone)),
        _or_nothing(lambda: false_closure_rate(*alone)),
    ]


def _or_nothing(metric: Callable[[], float]) -> float:
    try:
        return metric()
    except UnavailableError:
        return np.nan


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), *map(int, sys.argv[3:]))
