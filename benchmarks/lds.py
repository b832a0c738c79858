"""Cross-validation of the linear dynamical system on a corpus: one table, and plots of what was identified.

python benchmarks/lds.py CORPUS -o report/ [--folds 5] [--limit 60]
"""

import argparse
from pathlib import Path

import numpy as np

from facesynth.atomic import write_text
from facesynth.config import load_config
from facesynth.corpus import Corpus
from facesynth.evaluation.papers.lds_crossvalidation import Errors, judge_fold, table
from facesynth.methods.lds.method import LDS
from facesynth.methods.lds.plots import plot_innovations, plot_orders

CONFIGS = Path(__file__).parents[1] / "configs"
NAMES = {"LDS": "lds.yaml", "LDS, the paper's features": "lds_paper.yaml"}


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("corpus", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--folds", type=int, default=5)
    parser.add_argument("--limit", type=int, help="at most so many utterances, evenly chosen")
    options = parser.parse_args()
    corpus = Corpus.open(options.corpus)
    if options.limit and len(corpus) > options.limit:
        places = np.linspace(0, len(corpus) - 1, options.limit).round().astype(int)
        corpus = corpus.subset([corpus.ids[place] for place in places])
    configs = {name: load_config(CONFIGS / file) for name, file in NAMES.items()}
    errors = Errors()
    for number, (train, test) in enumerate(corpus.folds(options.folds), start=1):
        judge_fold(errors, configs, train, test)
        head = f"{len(corpus)} utterances, {number} of {options.folds} folds\n\n"
        write_text(options.output / "table.md", head + table(errors, corpus.layout.unit) + "\n")
    print(table(errors, corpus.layout.unit))
    model = LDS.from_config(configs["LDS"]).fit(corpus)
    plot_orders(model, options.output / "orders.png")
    plot_innovations(model, options.output / "innovations.png")


if __name__ == "__main__":
    main()
