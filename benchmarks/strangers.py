"""A talker's models driven by another talker's voice: `python benchmarks/strangers.py CORPUS STRANGERS [--methods …]`.

Ridge and the small network learn from four fifths of CORPUS, from each kind of features, and say the last fifth of it and all
of STRANGERS, a corpus of somebody else in the same layout. Printed are correlations of the lip opening with that of the
speaker's own lips, over all frames of a set, and for the same speaker the mean distance of markers.
"""

import argparse
from pathlib import Path

import numpy as np
import torch

from facesynth.corpus import Corpus
from facesynth.inference.lips import lip_gap
from facesynth.methods.learn.hearing import WIDTHS
from facesynth.methods.method import Method
from facesynth.methods.registry import create


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("strangers", type=Path)
    parser.add_argument("--methods", nargs="+", default=["ridge", "tcn"])
    parser.add_argument("--features", nargs="+", default=list(WIDTHS))
    options = parser.parse_args()
    torch.set_num_threads(1)
    learned, unseen = Corpus.open(options.corpus).split(seed=0, test_share=0.2)
    strangers = Corpus.open(options.strangers)
    for method in options.methods:
        for features in options.features:
            model = create(method, features=features).fit(learned, seed=0)
            own, error = judged(model, unseen)
            other, _ = judged(model, strangers)
            print(
                f"{method:6s} {features:10s} same speaker: correlation {own:.3f}, error {error:.3f}; stranger: {other:.3f}",
                flush=True,
            )


def judged(model: Method, corpus: Corpus) -> tuple[float, float]:
    """Correlation of the lip opening over all frames, each clip about its own mean, and the mean distance of points."""
    said, recorded, distances = [], [], []
    for utterance in corpus:
        motion = model.synthesize(utterance.speech)
        count = min(len(motion), len(utterance.motion))
        ours, theirs = lip_gap(motion)[:count], lip_gap(utterance.motion)[:count]
        there = ~np.isnan(theirs)
        said.append(ours[there] - ours[there].mean())
        recorded.append(theirs[there] - theirs[there].mean())
        apart = motion.layout.points(motion.frames[:count] - utterance.motion.frames[:count])
        distances.append(np.nanmean(np.linalg.norm(apart, axis=-1)))
    return float(np.corrcoef(np.concatenate(said), np.concatenate(recorded))[0, 1]), float(np.mean(distances))


if __name__ == "__main__":
    main()
