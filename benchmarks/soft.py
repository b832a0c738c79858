"""How long the soft forms take to speak, beside the same models searching for the cheapest path.

python benchmarks/soft.py CORPUS MODEL... [--sentences 20]

MODEL: files written by `facesynth train efase|anime_graph CORPUS` with configs/efase_soft.yaml or anime_graph_soft.yaml.
Prints seconds by the clock and of the processor for each second of speech, on one thread, everything from sound to
motion included; the first sentence, which compiles, is not counted.
"""

import argparse
import time
from pathlib import Path

import torch

from facesynth.corpus import Corpus, Utterance
from facesynth.methods.method import Method
from facesynth.methods.registry import load


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("models", type=Path, nargs="+", metavar="MODEL")
    parser.add_argument("--sentences", type=int, default=20)
    options = parser.parse_args()
    torch.set_num_threads(1)
    corpus = Corpus.open(options.corpus)
    spoken = [corpus[i] for i in corpus.ids[: options.sentences + 1]]
    print("| model | temperature | clock, s per s of speech | processor, s per s |\n|---|---:|---:|---:|")
    for path in options.models:
        for temperature in dict.fromkeys([load(path).config["temperature"], 0.0]):
            model = load(path)
            model.config["temperature"] = temperature  # before it speaks: what speaks is made once
            clock, processor = real_time_factors(model, spoken)
            print(f"| {path.name} | {temperature:.3g} | {clock:.3f} | {processor:.3f} |", flush=True)


def real_time_factors(model: Method, spoken: list[Utterance]) -> tuple[float, float]:
    """Seconds by the clock and of the processor for each second of speech, without the first utterance."""
    model.synthesize(spoken[0].speech)
    speech_s = sum(utterance.speech.duration_s for utterance in spoken[1:])
    clock, processor = time.perf_counter(), time.process_time()
    for utterance in spoken[1:]:
        model.synthesize(utterance.speech)
    return (time.perf_counter() - clock) / speech_s, (time.process_time() - processor) / speech_s


if __name__ == "__main__":
    main()
