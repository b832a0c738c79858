"""Train a method of the head on a corpus, judge it on recordings left out, and save it.

python train/head.py CORPUS [--method head_hmm] [--config configs/head_hmm.yaml] [-o head.safetensors] [--seed 0]
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from facesynth.config import load_config
from facesynth.corpus import Corpus
from facesynth.evaluation.head import head_cca, head_distance
from facesynth.inference.motion import Motion
from facesynth.methods.learn.heads import mean_head, with_head
from facesynth.methods.registry import method_class
from facesynth.methods.training import train as learn

CONFIGS = Path(__file__).parents[1] / "configs"


def main(arguments: list[str] | None = None) -> None:
    options = parse(arguments)

    # Load, and leave sentences out.
    corpus = Corpus.open(options.corpus)
    train, test = corpus.split(options.seed)
    print(f"{corpus.performer}: {len(train)} utterances to learn from, {len(test)} to judge by")

    # Fit.
    config = load_config(options.config or CONFIGS / f"{options.method}.yaml")
    model = learn(method_class(options.method), train, config, seed=options.seed, device=options.device)
    print(", ".join(f"{name} {value}" for name, value in model.facts.items()))

    # Evaluate: head rotation against the recorded one, beside a head that stays where it usually is.
    rest = mean_head(with_head(train))
    rows = []
    for utterance in with_head(test):
        moved = model.synthesize(utterance.speech, seed=options.seed)
        count = min(len(moved), len(utterance.motion))
        own, truth = head_alone(moved, count), head_alone(utterance.motion, count)
        still = replace(own, head=np.tile(rest, (count, 1)).astype(np.float32))
        rows.append((head_cca(own, truth), head_distance(own, truth), head_distance(still, truth)))
    cca, off, still_off = np.mean(rows, axis=0)
    print(f"sentences left out: canonical correlation {cca:.2f}, {off:.2f} degrees off; a still head {still_off:.2f}")

    # Save.
    model.save(options.output)
    print(f"{options.output} written; `facesynth speak MOUTH speech.wav --head {options.output} -o out.mp4`")


def head_alone(motion: Motion, count: int) -> Motion:
    """The first frames of a motion, its face at rest."""
    assert motion.head is not None  # noqa: S101 - with_head has chosen
    return replace(motion, frames=np.zeros_like(motion.frames[:count]), head=motion.head[:count], eyes=None)


def parse(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("corpus", type=Path)
    parser.add_argument("--method", choices=("head_knn", "head_hmm"), default="head_hmm")
    parser.add_argument("--config", type=Path)
    parser.add_argument("-o", "--output", type=Path, default=Path("head.safetensors"))
    parser.add_argument("--device", help="auto, cpu, cuda or mps; as the settings say otherwise")
    parser.add_argument("--seed", type=int, default=0)
    return parser.parse_args(arguments)


if __name__ == "__main__":
    main()
