"""Is the mean of several networks nearer than one, and can one learn to be it? python benchmarks/ensembles.py CORPUS -o FOLDER

Networks of a fold of `network_variants.py` that differ in their seed alone; the mean of their poses; and networks that learn from
that mean's poses of the same recordings in place of the recorded ones, or from halfway between both. Printed are lip error and
energy on all other clips of the corpus, clip by clip beside the first network (Wilcoxon, Holm). FOLDER keeps the networks.
"""

import argparse
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from frontier_curve import steps
from frontier_table import Motions
from network_variants import VARIANTS, Variant, file_of, inner, kept, parts

from facesynth.corpus import Corpus, Utterance
from facesynth.evaluation.dynamics import energy_ratio
from facesynth.evaluation.geometry import lve
from facesynth.inference.arrays import Floats
from facesynth.methods.learn.expectation import PosePredictor
from facesynth.methods.network.method import Network

SHARES = {"that learned the mean's poses": 1.0, "that learned halfway between them and the recorded ones": 0.5}
"""Of the mean in what a network learns."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--fold", type=int, default=1)
    parser.add_argument("--variant", choices=list(VARIANTS), default="both")
    parser.add_argument("--members", type=int, default=3)
    parser.add_argument("--steps", type=int, help="of the training; the network's own unless given")
    parser.add_argument("--device", default="cpu", help="where networks learn")
    options = parser.parse_args()
    corpus = Corpus.open(options.corpus)
    learned, _ = inner(parts(corpus, options.fold)[0], options.fold)
    others = corpus.subset([name for name in corpus.ids if name not in set(learned.ids)])
    variant = VARIANTS[options.variant] | Variant({"steps": options.steps} if options.steps else {})

    def network(kind: str, seed: int) -> Network:
        path = options.output / file_of(f"{options.variant}{kind}", options.fold, options.steps, seed)
        return kept(path, learned, variant, seed, options.device)

    members = [network("", seed) for seed in range(options.members)]
    rows = {f"one, seed {seed}": spoken(one, others) for seed, one in enumerate(members)}
    rows["the mean of them"] = mean_of(list(rows.values()))
    known = mean_of([spoken(one, learned) for one in members])
    for name, share in SHARES.items():
        with teaching(known, share):
            rows[f"one {name}"] = spoken(network(f" taught {share:g} by {options.members}", 0), others)
    print(f"{len(learned)} clips to learn from, {len(others)} spoken\n")
    print("\n".join(table(rows, list(others))))


def spoken(model: Network, clips: Corpus) -> Motions:
    return {u.id: model.synthesize(u.speech) for u in clips}


def mean_of(rows: Sequence[Motions]) -> Motions:
    """The mean pose at every moment."""
    return {name: replace(one, frames=np.mean([row[name].frames for row in rows], axis=0)) for name, one in rows[0].items()}


@contextmanager
def teaching(known: Motions, share: float) -> Iterator[None]:
    """Networks learn so much of these motions and the rest of the recorded ones."""
    own = PosePredictor.recording

    def recording(predictor: PosePredictor, utterance: Utterance, *rest: Any) -> Any:
        shown = replace(utterance.motion, frames=between(utterance.motion.frames, known[utterance.id].frames, share))
        return own(predictor, replace(utterance, motion=shown), *rest)

    with patch.object(PosePredictor, "recording", recording):
        yield


def between(recorded: np.ndarray, made: np.ndarray, share: float) -> np.ndarray:
    """Recorded frames [T, C] moved towards made ones as far as these reach; gaps stay gaps."""
    count, shown = min(len(recorded), len(made)), recorded.copy()
    shown[:count] += share * (made[:count] - recorded[:count])
    return shown


def table(rows: Mapping[str, Motions], clips: Sequence[Utterance]) -> list[str]:
    """In Markdown, each row beside the first."""
    errors = {name: np.array([lve(made[u.id], u.motion) for u in clips]) for name, made in rows.items()}
    energies = {name: np.mean([energy_ratio(made[u.id], u.motion) for u in clips]) for name, made in rows.items()}
    first, *more = errors
    beside: dict[str, dict[int, Floats]] = {name: {1: errors[first], 2: errors[name]} for name in more}
    lines = ["| network | lip error, mm | energy | nearer than the first, mm | in clips | p |", "|---" + "|---:" * 5 + "|"]
    lines.append(f"| {first} | {errors[first].mean():.3f} | {energies[first]:.2f} | | | |")
    for step in steps(beside):
        compared = f"{step.gain:.3f} | {step.nearer} of {step.sentences} | {step.p:.2g}"
        lines.append(f"| {step.row} | {errors[step.row].mean():.3f} | {energies[step.row]:.2f} | {compared} |")
    return lines


if __name__ == "__main__":
    main()
