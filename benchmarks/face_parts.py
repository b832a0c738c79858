"""Size and speed of the models that make one face: mouth by key shapes, expression, heads, eyes; one core.

python benchmarks/face_parts.py CORPUS [--count 10] [--train-limit 400]

Each is trained on CORPUS, and heads and eyes that come with the package are loaded; then each moves the same COUNT utterances,
one after the other as one speech. Real-time factor: processor time of one thread over the length of what is said, the best of
four, as models are warm then. A model that CORPUS cannot teach has the reason in its row.
"""

import argparse
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import torch
from threadpoolctl import threadpool_limits

from facesynth.config import load_config
from facesynth.corpus import Corpus
from facesynth.evaluation.cost import MB, stopwatch
from facesynth.evaluation.folds import some_of
from facesynth.evaluation.papers.joined import joined
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion
from facesynth.inference.speech import EmotionTrack, Speech
from facesynth.methods.capabilities import Expressing, Looking
from facesynth.methods.registry import ask, create, load_trained
from facesynth.methods.trained import TrainedModel
from facesynth.stage.whole_face import EYES, HEAD
from facesynth.zoo.shelf import entry_of, find

CONFIGS = Path(__file__).parents[1] / "configs"
TRAINED = {
    "co-articulation": ("coarticulation", "coarticulation.yaml"),
    "expression": ("expression", "expression.yaml"),
    "head, nearest movements": ("head_knn", "head_knn.yaml"),
    "head, hidden Markov models": ("head_hmm", "head_hmm.yaml"),
    "eyes": ("eyes", "eyes.yaml"),
}
PACKAGED = {"head of the package": HEAD, "eyes of the package": EYES}
MOST_RTF, MOST_MB = 0.05, 2.0
REPEATS = 3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--train-limit", type=int, default=400)
    options = parser.parse_args()
    torch.set_num_threads(1)
    corpus = Corpus.open(options.corpus)
    learned = corpus.subset(some_of(corpus.ids, options.train_limit, 0))
    said = [corpus[i].speech for i in some_of(corpus.ids, options.count, 1)]
    speech = joined(said, sum(len(one.phones) for one in said))
    print(f"{corpus.performer}: {len(learned)} utterances learned from, {speech.duration_s:.0f} s moved, {corpus.fps:g} fps\n")
    print("| model | MB | real-time factor | under 2 MB and 0.05 |\n|---|---:|---:|---|")
    with threadpool_limits(1), tempfile.TemporaryDirectory() as folder:
        for name, (method, config) in TRAINED.items():
            print(
                row(name, lambda m=method, c=config: trained(m, c, learned, Path(folder) / f"{m}.safetensors"), speech),
                flush=True,
            )
        for name, model in PACKAGED.items():
            print(row(name, lambda model=model: find(model), speech), flush=True)


def trained(method: str, config: str, corpus: Corpus, path: Path) -> Path:
    create(method, **load_config(CONFIGS / config)).fit(corpus).save(path)
    return path


def row(name: str, made: Callable[[], Path], speech: Speech) -> str:
    """A line of the table."""
    try:
        path = made()
    except FacesynthError as reason:
        return f"| {name} | — | — | {reason} |"
    model = load_trained(path)
    size = (entry_of(path).size_bytes if path.is_dir() else path.stat().st_size) / MB
    factor = min(timed(model, speech) for _ in range(REPEATS + 1)) / speech.duration_s
    return f"| {name} | {size:.2f} | {factor:.4f} | {'yes' if size < MOST_MB and factor < MOST_RTF else 'NO'} |"


def timed(model: TrainedModel, speech: Speech) -> float:
    """Processor seconds for what the model moves: itself, or what it adds to a motion that is there."""
    expressing, looking = ask(model, Expressing), ask(model, Looking)
    if expressing:
        felt = replace(speech, emotions=EmotionTrack.constant(model.emotions[-1], speech.duration_s))
        still = at_rest(model, speech)
        with stopwatch() as spent:
            expressing.express(still, felt)
    elif looking:
        still = at_rest(model, speech)
        with stopwatch() as spent:
            looking.look(still)
    else:
        with stopwatch() as spent:
            model.synthesize(speech)
    return spent.processor_s


def at_rest(model: TrainedModel, speech: Speech) -> Motion:
    """A face and a head that do not move."""
    motion = model.synthesize(replace(speech, emotions=EmotionTrack.constant("neutral", speech.duration_s)))
    return replace(motion, frames=motion.frames[:1].repeat(len(motion), axis=0), eyes=None)


if __name__ == "__main__":
    main()
