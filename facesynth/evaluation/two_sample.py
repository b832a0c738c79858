"""Can a classifier tell synthesised lips from recorded ones? (A classifier two-sample test.)

It sees stretches of lip shapes, with how fast they move, of half of the utterances, recorded and synthesised alike, and is
asked about those of the other half, and the other way round. 0.5: it guesses, and no motion is better; 1: told at a glance.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from facesynth.evaluation.lip_shapes import LipShapes, windows
from facesynth.evaluation.pair import Array, UnavailableError
from facesynth.inference.motion import Motion

if TYPE_CHECKING:
    from sklearn.pipeline import Pipeline

LENGTH = 8
"""Frames of a stretch: 0.32 s."""
MOST = 1500
"""Stretches of each kind that are learned from."""
FEWEST = 4
"""Utterances."""


def two_sample(shapes: LipShapes, made: Mapping[str, Motion], recorded: Mapping[str, Motion], seed: int = 0) -> dict[str, float]:
    """By utterance the balanced accuracy of a classifier that learned from the other half of the utterances.

    made, recorded: motion by utterance, of the same utterances. UnavailableError where these are too few or too short.
    """
    pairs = {name: (_stretches(shapes, made[name]), _stretches(shapes, recorded[name])) for name in sorted(made)}
    pairs = {name: pair for name, pair in pairs.items() if len(pair[0]) and len(pair[1])}
    if len(pairs) < FEWEST:
        raise UnavailableError(
            f"telling recorded from synthesised lips takes {FEWEST} utterances of half a second; got {len(pairs)}"
        )
    rng = np.random.default_rng(seed)
    names = rng.permutation(np.array(list(pairs), object))
    halves = names[::2], names[1::2]
    found: dict[str, float] = {}
    for learned, asked in (halves, halves[::-1]):
        classifier = _learn([pairs[name] for name in learned], rng)
        for name in asked:
            told = [classifier.predict(stretches) == kind for kind, stretches in enumerate(pairs[name])]
            found[name] = float(np.mean([right.mean() for right in told]))
    return found


def _stretches(shapes: LipShapes, motion: Motion) -> Array:
    """[n, …] shapes and their velocities over LENGTH frames, every other stretch, those with gaps left out."""
    signal = shapes.of(motion)
    moving = np.concatenate([signal, np.gradient(signal, axis=0)], axis=1) if len(signal) > 1 else np.tile(signal, (1, 2))
    flat = windows(moving, LENGTH)[::2]
    flat = flat.reshape(len(flat), -1)
    return flat[np.isfinite(flat).all(axis=1)]


def _learn(pairs: list[tuple[Array, Array]], rng: np.random.Generator) -> "Pipeline":
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler
    from sklearn.svm import SVC

    kinds = [np.concatenate([pair[kind] for pair in pairs]) for kind in (0, 1)]
    count = min(MOST, *map(len, kinds))
    some = [kind[rng.permutation(len(kind))[:count]] for kind in kinds]
    classifier = make_pipeline(StandardScaler(), SVC(C=3.0))
    return classifier.fit(np.concatenate(some), np.repeat([0, 1], count))
