"""Methods on a few long takes: the table of an evaluation, beside an older one's, and who is nearer, block by block.

python benchmarks/takes.py CORPUS PREDICTIONS [--older PREDICTIONS] [--takes ID …] [--block-s 5] [--against network efase]

PREDICTIONS are the folders that `facesynth evaluate CORPUS … -o report/` leaves in `report/predictions`. Four takes tell no two
methods apart (p is at least 1/8), so each is cut into blocks: a block's figure is the lip error (`lve`) of its frames. Blocks of
two rows are compared in pairs (Wilcoxon, Holm over the rows), and how much a difference tells of that of the next block is
printed (correlation; where it is not near 0 the blocks are too short).
"""

import argparse
from pathlib import Path

import numpy as np
from scipy.stats import wilcoxon

from facesynth.corpus import Corpus
from facesynth.evaluation.dynamics import energy_ratio
from facesynth.evaluation.geometry import lve, marker_error
from facesynth.evaluation.paired import holm
from facesynth.evaluation.predictions import load_prediction
from facesynth.inference.motion import Motion

Takes = dict[str, Motion]
"""Motions by utterance."""
Blocks = dict[str, np.ndarray]
"""By utterance [B] lip error of each block (unit of the layout)."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus")
    parser.add_argument("predictions", type=Path)
    parser.add_argument("--older", type=Path, help="predictions of the same takes, of rows by the same names")
    parser.add_argument("--takes", nargs="*", help="of which the figures are; all otherwise. Rows that lack one are left out")
    parser.add_argument("--block-s", type=float, default=5.0)
    parser.add_argument("--against", nargs="*", default=["network"], help="rows that all others are compared with")
    asked = parser.parse_args()
    corpus = Corpus.open(asked.corpus)
    truth = {name: corpus[name].motion for name in asked.takes or corpus.ids}
    rows = predicted(asked.predictions, truth)
    older = predicted(asked.older, truth) if asked.older else {}
    cut = {label: blocks(takes, truth, asked.block_s) for label, takes in rows.items()}
    table(rows, truth)
    compare(
        "today beside the older code, of the same name: more by",
        {label: (cut[label], blocks(takes, truth, asked.block_s)) for label, takes in older.items() if label in cut},
    )
    for one in asked.against:
        pairs = {label: (each, cut[one]) for label, each in cut.items() if label != one}
        compare(f"beside {one}: more by", pairs)


def predicted(folder: Path, truth: Takes) -> dict[str, Takes]:
    """Rows that have a motion of every take; `mean_face` and `mean face` are one name."""
    found = {}
    for row in sorted(path for path in folder.iterdir() if path.is_dir()):
        if all((row / f"{name}.npz").is_file() for name in truth):
            found[row.name.replace("_", " ")] = {name: load_prediction(row / f"{name}.npz")[1] for name in truth}
    return found


def table(rows: dict[str, Takes], truth: Takes) -> None:
    """Means over takes, and the lip error of each."""
    print("| | mean error | `lve` | energy ratio | `lve` by take |\n|---|---:|---:|---:|---|")
    lines = []
    for label, takes in rows.items():
        error, energy = (np.mean([f(takes[n], truth[n]) for n in truth]) for f in (marker_error, energy_ratio))
        lips = [lve(takes[name], truth[name]) for name in truth]
        lines.append((np.mean(lips), f"{label} | {error:.4f} | {np.mean(lips):.3f} | {energy:.2f}", lips))
    for _, line, lips in sorted(lines):
        print(f"| {line} | {', '.join(f'{one:.3f}' for one in lips)} |")


def blocks(takes: Takes, truth: Takes, block_s: float) -> Blocks:
    """Lip errors of whole blocks; what is left at the end of a take goes with its last one."""
    found = {}
    for name, motion in takes.items():
        length = round(block_s * motion.fps)
        starts = np.arange(max(1, len(motion) // length)) * length
        ends = [*starts[1:], len(motion)]
        found[name] = np.array(
            [lve(stretch(motion, a, b), stretch(truth[name], a, b)) for a, b in zip(starts, ends, strict=True)]
        )
    return found


def stretch(motion: Motion, first: int, last: int) -> Motion:
    return Motion(motion.frames[first:last], motion.fps, motion.layout)


def compare(title: str, pairs: dict[str, tuple[Blocks, Blocks]]) -> None:
    """Paired differences, first minus second, of all takes together and of each."""
    if not pairs:
        return
    apart = {label: {name: first[name] - second[name] for name in first} for label, (first, second) in pairs.items()}
    together = {label: np.concatenate(list(takes.values())) for label, takes in apart.items()}
    chances = holm([chance(each) for each in together.values()])
    print(f"\n{title}\n")
    for (label, takes), p in zip(apart.items(), chances, strict=True):
        each = together[label]
        by_take = ", ".join(f"{one.mean():+.4f} ({(one > 0).sum()} of {len(one)})" for one in takes.values())
        print(
            f"- {label}: {each.mean():+.4f}, farther in {(each > 0).sum()} and nearer in {(each < 0).sum()} of {len(each)}"
            f" blocks, p = {p:.2g}; by take {by_take}; next block {following(takes):.2f}"
        )


def chance(differences: np.ndarray) -> float:
    return float(wilcoxon(differences).pvalue) if differences.any() else 1.0


def following(takes: Blocks) -> float:
    """Correlation of each block's difference with that of the block after it, over all takes."""
    mine, next_one = (np.concatenate([one[part] for one in takes.values()]) for part in (slice(None, -1), slice(1, None)))
    return float(np.corrcoef(mine, next_one)[0, 1]) if mine.std() and next_one.std() else float("nan")


if __name__ == "__main__":
    main()
