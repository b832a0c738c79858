"""Emotion maps by each ordered pair on sentences left out, with the components as found and mixed by a random rotation.

python benchmarks/emotion_maps.py CORPUS [--sentences 20] [--folds 4] [--rotations 1]

Components and split are learned again without the sentences that are left out. A rotation mixes speech and emotion into
every component of lips and upper face together, so that none is emotional and little else.
"""

import argparse
from itertools import permutations
from pathlib import Path

import numpy as np
from scipy.stats import special_ortho_group

from facesynth.corpus import Corpus
from facesynth.methods.anime_graph.components import FaceComponents
from facesynth.methods.anime_graph.parallel import take_of
from facesynth.methods.anime_graph.report import Learner, MapTrial, learner
from facesynth.methods.anime_graph.split import split_components

KIND = "exponential cross-validated"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("corpus", type=Path)
    parser.add_argument("--sentences", type=int, default=20, help="that are judged: those in the most emotions")
    parser.add_argument("--folds", type=int, default=4)
    parser.add_argument("--rotations", type=int, default=1)
    options = parser.parse_args()
    corpus = Corpus.open(options.corpus)
    components = FaceComponents().fit(finite(corpus), corpus.layout, variance=0.98, seed=0)
    takes = [take for u in corpus if (take := take_of(u, components)) is not None]
    plain = learner(corpus.layout, variance=0.98)
    ways = {"as found": plain}
    for seed in range(options.rotations):
        ways[f"rotated, seed {seed}"] = rotated(plain, corpus, seed)
    print("| components | from | to | unchanged | mean difference | map |\n|---|---|---|---:|---:|---:|")
    for name, way in ways.items():
        report(name, MapTrial(takes, corpus.layout, way, kinds=(KIND,)).with_sentences(options.sentences), corpus, options.folds)


def finite(corpus: Corpus) -> np.ndarray:
    """[N, C] frames without gaps."""
    frames = corpus.arrays().frames
    return frames[np.isfinite(frames).all(axis=1)]


def rotated(plain: Learner, corpus: Corpus, seed: int) -> Learner:
    """Components as `plain` finds them, turned at random; the split is made again."""

    def learn(takes):  # type: ignore[no-untyped-def]
        from dataclasses import replace

        found, _ = plain(takes)
        turn = special_ortho_group.rvs(found.count, random_state=seed)
        components = FaceComponents()
        components.keep(found.mean.numpy(), found.mixing.numpy() @ turn, found.block.numpy())
        again = [replace(take, components=components.encode_array(take.frames)) for take in takes]
        return components, split_components(again, components, corpus.layout, None, seed=0)

    return learn


def report(name: str, trial: MapTrial, corpus: Corpus, folds: int) -> None:
    """A row for each pair, in thousandths of the unit cube, and what was found in the first fold's recordings."""
    helped = []
    for source, target in permutations(corpus.emotions, 2):
        score = trial.score(source, target, folds=folds)
        row = (1000 * x for x in (score.unchanged, score.mean_difference, score.mapped[KIND]))
        print(f"| {name} | {source} | {target} | " + " | ".join(f"{x:.2f}" for x in row) + " |", flush=True)
        helped.append(score.helps(KIND))
    print(f"\n{name}: {trial.without().split.summary()}; nearer than both on {sum(helped)} of {len(helped)} pairs.\n", flush=True)


if __name__ == "__main__":
    main()
