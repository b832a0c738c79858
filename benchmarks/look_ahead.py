"""What waiting is worth to a network that hears sound alone: python benchmarks/look_ahead.py CORPUS -o FOLDER [--hears phone_net]

Networks of a fold of `network_variants.py` that may hear 0, 40, 80, 160 and 320 ms of the sound after a frame, and one that hears
as far ahead as it looks back. They learn from what the fold's networks learn from, and speak all other clips of the corpus as
their streams do, sound alone coming in pieces. Printed are how late such a stream is at most, the lip error, energy, closures at
p, b and m, and how much nearer the network that waits longer is, clip by clip (Wilcoxon, Holm). FOLDER keeps the networks.
"""

import argparse
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from frontier_curve import steps
from frontier_table import figures
from network_variants import BY_EAR, LOOK_AHEAD_MS, VARIANTS, Variant, file_of, inner, kept, parts
from streams import RATE, streamed

from facesynth.corpus import Corpus
from facesynth.evaluation.lips import closure_threshold
from facesynth.inference.arrays import Floats
from facesynth.inference.network import AHEAD_S
from facesynth.methods.network.method import Network

COLUMNS = ("may hear ahead, ms", "late, s", "lip error, mm", "energy", "closure", "the next is nearer, mm", "in clips", "p")


@dataclass(frozen=True)
class Row:
    """What networks that look so far ahead are worth."""

    late_s: float
    """That a frame of the stream waits at most."""
    errors: Floats
    """[clips] mm of the lips."""
    energy: float
    closure: float


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
    print(f"{options.hears}: {len(learned)} clips to learn from, {len(others)} spoken", flush=True)
    shorter = Variant({"steps": options.steps} if options.steps else {})
    rows: dict[int, Row] = {}
    for ahead in (*(f" {ms} ms" for ms in LOOK_AHEAD_MS), ""):
        name = f"sound, {options.hears}{ahead}"
        path = options.output / file_of(name, options.fold, options.steps, options.seed)
        network = kept(path, learned, VARIANTS[name] | shorter, options.seed, options.device)
        expectation = network.speaker().expectation
        rows[round(1000 * expectation.ahead / expectation.reading.rate)] = judged(network, others)
    print("\n".join(table(rows)))


def judged(network: Network, clips: Corpus) -> Row:
    """What its stream gives of clips that it never heard."""
    said, speaker = list(clips), network.speaker()
    threshold = closure_threshold((u.motion, u.speech.phones) for u in said)
    speak = streamed(speaker, AHEAD_S, piece=RATE)  # a second; how it is cut changes nothing
    lines = np.array([figures(speak(u.speech), u, threshold) for u in said])
    _, energy, _, closure, _ = np.nanmean(lines, axis=0)
    return Row(speaker.late_s(AHEAD_S), lines[:, 0], float(energy), float(closure))


def table(rows: Mapping[int, Row]) -> list[str]:
    """In Markdown, each look-ahead (ms) in a row, beside the next one."""
    further = steps({"": {ms: row.errors for ms, row in rows.items()}})
    compared = [f"{step.gain:.3f} | {step.nearer} of {step.sentences} | {step.p:.2g}" for step in further]
    lines = [f"| {' | '.join(COLUMNS)} |", "|" + "---:|" * len(COLUMNS)]
    for (ms, row), beside in zip(rows.items(), [*compared, " | | "], strict=True):
        lines.append(f"| {ms} | {row.late_s:.2f} | {row.errors.mean():.3f} | {row.energy:.2f} | {row.closure:.2f} | {beside} |")
    return lines


if __name__ == "__main__":
    main()
