"""What waiting is worth to a network that hears sound alone: python benchmarks/look_ahead.py CORPUS -o FOLDER [--hears phone_net]

Networks of a fold of `network_variants.py` that may hear 0, 40, 80, 160 and 320 ms of the sound after a frame, and one that hears
as far ahead as it looks back. They learn from what the fold's networks learn from, and speak all other clips of the corpus as
their streams do, sound alone coming in pieces. Printed are how late such a stream is at most, the lip error, energy, closures at
p, b and m, and how much nearer the network that waits longer is, clip by clip (Wilcoxon, Holm). FOLDER keeps the networks.
"""

import argparse
from pathlib import Path

import numpy as np
from frontier_table import figures
from network_variants import BY_EAR, LOOK_AHEAD_MS, VARIANTS, Variant, file_of, inner, kept, parts
from scipy.stats import wilcoxon
from streams import streamed

from facesynth.corpus import Corpus
from facesynth.evaluation.lips import closure_threshold
from facesynth.evaluation.paired import holm
from facesynth.inference.network import AHEAD_S
from facesynth.methods.network.method import Network

COLUMNS = ("may hear ahead", "late, s", "lip error, mm", "energy", "closure", "nearer if it waits longer, mm", "clips", "p")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--hears", choices=list(BY_EAR), default="log_mel")
    parser.add_argument("--fold", type=int, default=1)
    parser.add_argument("--steps", type=int, help="of the training; the network's own unless given")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--device", default="cpu", help="where networks learn")
    options = parser.parse_args()
    corpus = Corpus.open(options.corpus)
    learned, _ = inner(parts(corpus, options.fold)[0], options.fold)
    others = corpus.subset([name for name in corpus.ids if name not in set(learned.ids)])
    print(f"{options.hears}: {len(learned.ids)} clips to learn from, {len(others.ids)} spoken", flush=True)
    shorter = Variant({"steps": options.steps} if options.steps else {})
    found: dict[str, tuple[float, np.ndarray]] = {}
    for ahead in (*(f"{ms} ms" for ms in LOOK_AHEAD_MS), ""):
        name = f"sound, {options.hears} {ahead}".rstrip()
        path = options.output / file_of(name, options.fold, options.steps, options.seed)
        network = kept(path, learned, VARIANTS[name] | shorter, options.seed, options.device)
        found[ahead or "all"] = network.speaker().late_s(AHEAD_S), judged(network, others)
    print_table(found)


def judged(network: Network, clips: Corpus) -> np.ndarray:
    """[clips, 3] lip error (mm), energy and closures of what a stream gives."""
    said, speak = list(clips), streamed(network.speaker(), AHEAD_S)
    threshold = closure_threshold((u.motion, u.speech.phones) for u in said)
    lines = np.array([figures(speak(u.speech), u, threshold) for u in said])
    return lines[:, [0, 1, 3]]


def print_table(found: dict[str, tuple[float, np.ndarray]]) -> None:
    """Each look-ahead [clips, 3] beside the next one."""
    errors = np.array([lines[:, 0] for _, lines in found.values()])
    nearer = errors[:-1] - errors[1:]
    chances = holm([float(wilcoxon(each).pvalue) for each in nearer])
    print(f"\n| {' | '.join(COLUMNS)} |\n|---" + (len(COLUMNS) - 1) * "|---:" + "|")
    for k, (ahead, (late_s, lines)) in enumerate(found.items()):
        error, energy, closure = np.nanmean(lines, axis=0)
        row = f"| {ahead} | {late_s:.2f} | {error:.3f} | {energy:.2f} | {closure:.2f} |"
        last = k == len(nearer)
        print(row + (" | | |" if last else f" {nearer[k].mean():.3f} | {(nearer[k] > 0).sum()} | {chances[k]:.1g} |"))


if __name__ == "__main__":
    main()
