"""Expressions added to a neutral mouth, on sentences left out: how near to the recorded emotion, and is it recognised?

python benchmarks/expression.py CORPUS/ [seed]     (sentences in neutral and in emotions, as the built-in performer has them)

The mouth is eFASE in neutral at the timing of the recorded emotional sentence. To its motion is added: nothing, the mean
difference of the emotion, an expression grown from patches, or the emotion map by radial basis functions of the anime graph.
"""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.corpus import Corpus, Utterance
from facesynth.evaluation.dynamics import energy_ratio
from facesynth.evaluation.emotion_recognition import EmotionRecogniser
from facesynth.evaluation.regions import lip_points, upper_face_points
from facesynth.inference.layout import Layout
from facesynth.inference.motion import Motion
from facesynth.inference.speech import NEUTRAL, EmotionTrack, Speech
from facesynth.methods.anime_graph.method import AnimeGraph
from facesynth.methods.anime_graph.report import unit_cube_rms
from facesynth.methods.efase.method import Efase
from facesynth.methods.expression.method import Expression, differences_of

INTENSITIES = (0.0, 0.25, 0.5, 0.75, 1.0)
Row = Callable[[Utterance, Motion], Motion]
"""From a recorded utterance and its neutral rendering to a motion in the utterance's emotion."""


def main(path: Path, seed: int = 0) -> None:
    corpus = Corpus.open(path)
    train, test = corpus.split(seed)
    space, mouth, maps = Expression().fit(train), Efase().fit(train), AnimeGraph().fit(train)
    recogniser = EmotionRecogniser.fit(train)
    said = [u for u in test if u.emotion in space.facts["expressions"]]
    neutral = [mouth.synthesize(in_emotion(u.speech, NEUTRAL)) for u in said]
    print(f"{corpus.performer}: {len(train)} utterances learned from, {len(said)} emotional ones of other sentences judged")
    print(f"eigenspace of {space.basis.shape[1]} dimensions: {space.facts['variance']:.1%} of the variance (paper: 86.5 %)")
    print(f"{'':34s} {'unit cube':>10s} {'recognised':>11s} {'upper face':>11s} {'lips':>6s}")
    means = mean_differences(train)
    rows: dict[str, Row] = {
        "neutral": lambda u, motion: motion,
        "mean difference": lambda u, motion: plus(motion, means[u.emotion]),
        "expression": lambda u, motion: space.express(motion, u.speech, seed=seed),
        "map by radial basis functions": lambda u, motion: maps.map_along(motion, in_emotion(u.speech, NEUTRAL), u.emotion),
        "eFASE in the emotion": lambda u, motion: mouth.synthesize(u.speech),
    }
    print(f"{'recorded':34s} {'':10s} {np.mean([recogniser.recognise(u.motion) == u.emotion for u in said]):11.2f}")
    for name, row in rows.items():
        told(name, [row(u, motion) for u, motion in zip(said, neutral, strict=True)], said, recogniser)
    for intensity in INTENSITIES:
        made = [
            space.express(motion, in_emotion(u.speech, u.emotion, intensity), seed=seed)
            for u, motion in zip(said, neutral, strict=True)
        ]
        told(f"expression at {intensity:g}", made, said, recogniser)
        if intensity == 0:
            same = all(a.frames.tobytes() == b.frames.tobytes() for a, b in zip(made, neutral, strict=True))
            print(f"{'':34s} the neutral motion to the byte: {'yes' if same else 'NO'}")


def told(name: str, made: list[Motion], said: list[Utterance], recogniser: EmotionRecogniser) -> None:
    layout = said[0].motion.layout
    pairs = [(motion, u.motion) for motion, u in zip(made, said, strict=True)]
    near = np.mean([unit_cube_rms(a.frames[whole(b)], b.frames[whole(b)], layout) for a, b in pairs])
    right = np.mean([recogniser.recognise(motion) == u.emotion for motion, u in zip(made, said, strict=True)])
    upper, lips = (
        np.mean([energy_ratio(part(a, points), part(b, points)) for a, b in pairs])
        for points in (upper_face_points(layout), lip_points(layout))
    )
    print(f"{name:34s} {near:10.4f} {right:11.2f} {upper:11.2f} {lips:6.2f}", flush=True)


def whole(motion: Motion) -> NDArray[np.bool_]:
    """[T] frames in which nothing is missing."""
    return np.asarray(np.isfinite(motion.frames).all(axis=1))


def part(motion: Motion, points: NDArray[np.int64]) -> Motion:
    """Some points of a motion."""
    kind, names = motion.layout.kind, tuple(motion.layout.names[k] for k in points)
    return Motion(motion.points[:, points].reshape(len(motion), -1), motion.fps, Layout(kind, names))


def in_emotion(speech: Speech, emotion: str, intensity: float = 1.0) -> Speech:
    """The same, said in one emotion."""
    return replace(speech, emotions=EmotionTrack.constant(emotion, speech.duration_s, intensity))


def mean_differences(corpus: Corpus) -> dict[str, NDArray[np.float64]]:
    """[C] of each emotion from its neutral twins."""
    found = differences_of(corpus)[0]
    return {
        e: np.nanmean(np.concatenate([d.frames for d in found if d.emotion == e]), axis=0) for e in {d.emotion for d in found}
    }


def plus(motion: Motion, shift: NDArray[np.float64]) -> Motion:
    """A motion with something added to every frame."""
    return replace(motion, frames=(motion.frames + shift).astype(np.float32))


if __name__ == "__main__":
    main(Path(sys.argv[1]), *map(int, sys.argv[2:]))
