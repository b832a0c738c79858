"""Expressions added to a neutral mouth, on sentences left out: how near to the recorded emotion, and is it recognised?

python benchmarks/expression.py CORPUS/ [seed]     (sentences in neutral and in emotions, as the built-in performer has them)

The mouth is eFASE in neutral at the timing of the recorded emotional sentence. To its motion is added: nothing, the mean
difference of the emotion, an expression (as in the dissertation; only what phones let expect; that with variety, which is the
default), or the emotion map by radial basis functions of the anime graph. Each utterance draws with a seed of its own.
"""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facesynth.config import load_config
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

INTENSITIES = (0.0, 0.125, 0.25, 0.375, 0.5, 0.75, 1.0)
CONFIGS = Path(__file__).parents[1] / "configs"
Row = Callable[[Utterance, Motion, int], Motion]
"""From a recorded utterance, its neutral rendering and a seed to a motion in the utterance's emotion."""


def main(path: Path, seed: int = 0) -> None:
    corpus = Corpus.open(path)
    train, test = corpus.split(seed)
    space, whole = (Expression.from_config(load_config(CONFIGS / f"expression{kind}.yaml")).fit(train) for kind in ("", "_paper"))
    expected = Expression(variety=0.0).fit(train)
    mouth, maps = Efase().fit(train), AnimeGraph().fit(train)
    recogniser = EmotionRecogniser.fit(train)
    said = [u for u in test if u.emotion in space.facts["expressions"]]
    neutral = [mouth.synthesize(in_emotion(u.speech, NEUTRAL)) for u in said]
    print(f"{corpus.performer}: {len(train)} utterances learned from, {len(said)} emotional ones of other sentences judged")
    for model in (whole, space):
        print(f"eigenspace of {model.basis.shape[1]} dimensions: {model.facts['variance']:.1%} of the variance")
    print(f"phones tell {space.facts['told_by_phones']:.1%} of the variance within emotions")
    print(f"{'':34s} {'unit cube':>10s} {'recognised':>11s} {'upper face':>11s} {'lips':>6s} {'nearer than the mean one':>32s}")
    means = mean_differences(train)
    rows: dict[str, Row] = {
        "neutral": lambda u, motion, _: motion,
        "mean difference": lambda u, motion, _: plus(motion, means[u.emotion]),
        "expression": lambda u, motion, drawn: space.express(motion, u.speech, seed=drawn),
        "expected by the phones alone": lambda u, motion, _: expected.express(motion, u.speech),
        "as in the dissertation": lambda u, motion, drawn: whole.express(motion, u.speech, seed=drawn),
        "map by radial basis functions": lambda u, motion, _: maps.map_along(motion, in_emotion(u.speech, NEUTRAL), u.emotion),
        "eFASE in the emotion": lambda u, motion, _: mouth.synthesize(u.speech),
    }
    print(f"{'recorded':34s} {'':10s} {np.mean([recogniser.recognise(u.motion) == u.emotion for u in said]):11.2f}")
    beside = distances([rows["mean difference"](u, motion, 0) for u, motion in zip(said, neutral, strict=True)], said)
    for name, row in rows.items():
        made = [row(u, motion, seed + n) for n, (u, motion) in enumerate(zip(said, neutral, strict=True))]
        told(name, made, said, recogniser, beside)
    for intensity in INTENSITIES:
        made = [
            space.express(motion, in_emotion(u.speech, u.emotion, intensity), seed=seed + n)
            for n, (u, motion) in enumerate(zip(said, neutral, strict=True))
        ]
        told(f"expression at {intensity:g}", made, said, recogniser, beside)
        if intensity == 0:
            same = all(a.frames.tobytes() == b.frames.tobytes() for a, b in zip(made, neutral, strict=True))
            print(f"{'':34s} the neutral motion to the byte: {'yes' if same else 'NO'}")


def distances(made: list[Motion], said: list[Utterance]) -> NDArray[np.float64]:
    """[N] unit-cube RMS of each motion to the recorded one."""
    pairs = [(motion, u.motion) for motion, u in zip(made, said, strict=True)]
    return np.array([unit_cube_rms(a.frames[present(b)], b.frames[present(b)], b.layout) for a, b in pairs])


def told(
    name: str, made: list[Motion], said: list[Utterance], recogniser: EmotionRecogniser, beside: NDArray[np.float64]
) -> None:
    """A line; beside [N]: distances of the mean difference, against which each utterance is compared."""
    layout = said[0].motion.layout
    pairs = [(motion, u.motion) for motion, u in zip(made, said, strict=True)]
    near = distances(made, said)
    gained = beside - near
    again = np.random.default_rng(0).choice(gained, (2000, len(gained))).mean(axis=1)
    low, high = 1e4 * np.quantile(again, [0.025, 0.975])
    paired = f"{(gained > 0).sum()} of {len(gained)}, by {1e4 * gained.mean():.1f} [{low:.1f}, {high:.1f}] e-4"
    right = np.mean([recogniser.recognise(motion) == u.emotion for motion, u in zip(made, said, strict=True)])
    upper, lips = (
        np.mean([energy_ratio(part(a, points), part(b, points)) for a, b in pairs])
        for points in (upper_face_points(layout), lip_points(layout))
    )
    print(f"{name:34s} {near.mean():10.4f} {right:11.2f} {upper:11.2f} {lips:6.2f} {paired:>32s}", flush=True)


def present(motion: Motion) -> NDArray[np.bool_]:
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
