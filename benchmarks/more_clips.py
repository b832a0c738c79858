"""What more recordings are worth to the network of poses: the same tested sentences, learned from parts of the others.

OMP_NUM_THREADS=1 python benchmarks/more_clips.py CORPUS -o FOLDER [--clips 200 800] [--features both] [--fold 1] [--steps 700]

A fifth of the sentences is tested (`--fold`, 1 to 5). Of the recordings of the others so many are learned from, at random, those
of a smaller number being among those of a larger one. Prints lip error (energy), the change where recordings double, tests
sentence by sentence, and the processor time of learning: hearing, regression and network, reading the corpus included. FOLDER
keeps models and figures; what is there is not learned again.
"""

import argparse
from pathlib import Path
from time import process_time

import numpy as np
import torch
from frontier_curve import curve_lines
from network_variants import fewer, parts

from facesynth.corpus import Corpus
from facesynth.evaluation.dynamics import energy_ratio
from facesynth.evaluation.geometry import lve
from facesynth.inference.arrays import Floats
from facesynth.methods.learn.expectation import STEPS
from facesynth.methods.learn.hearing import WIDTHS
from facesynth.methods.network.method import Network

Figures = dict[str, Floats]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--clips", type=int, nargs="+", default=[200, 800])
    parser.add_argument("--features", choices=list(WIDTHS), default="both")
    parser.add_argument("--fold", type=int, default=1)
    parser.add_argument("--steps", type=int, default=STEPS, help="of the training, whatever is learned from")
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    rest, tested = parts(Corpus.open(options.corpus), options.fold)
    found: dict[int, Figures] = {}
    for count in sorted(options.clips):
        stem = options.output / f"network_{options.features}_{options.fold}_{count}clips_{options.steps}steps"
        method = Network(features=options.features, steps=options.steps)
        found[count] = measured(method, fewer(rest, options.fold, count)[0], tested, stem)
        print(line(count, found[count]), flush=True)
    if len(found) > 1:
        errors = {count: by_sentence(figures["errors"], tested) for count, figures in found.items()}
        energies = {count: float(figures["energies"].mean()) for count, figures in found.items()}
        print("\n".join(curve_lines({"network": errors}, {"network": energies})))


def measured(network: Network, learned: Corpus, tested: Corpus, stem: Path) -> Figures:
    """Errors (mm) and energies [U] of the tested clips, and what learning took, kept in files."""
    figures = stem.with_suffix(".npz")
    if not figures.is_file():
        began = process_time()
        network.fit(learned)
        seconds = process_time() - began
        network.save(stem.with_suffix(".safetensors"))
        pairs = [(network.synthesize(u.speech), u.motion) for u in tested]
        lips, energies = ([judge(*pair) for pair in pairs] for judge in (lve, energy_ratio))
        heard = sum(u.speech.duration_s for u in learned)
        np.savez(figures, errors=lips, energies=energies, seconds=seconds, heard_s=heard, threads=torch.get_num_threads())
    return dict(np.load(figures))


def by_sentence(errors: Floats, tested: Corpus) -> Floats:
    """[S] mean over a sentence's recordings, which are not independent."""
    names = [tested.record(name).sentence for name in tested.ids]
    _, numbers = np.unique(names, return_inverse=True)
    return np.bincount(numbers, weights=errors) / np.bincount(numbers)


def line(count: int, figures: Figures) -> str:
    return (
        f"{count} clips ({figures['heard_s'] / 60:.1f} min): lip error {figures['errors'].mean():.3f} mm, energy "
        f"{figures['energies'].mean():.2f}; {figures['seconds']:.0f} s of processor time, {figures['threads']} threads"
    )


if __name__ == "__main__":
    main()
