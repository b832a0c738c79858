"""Near and lively: searches and the network beside each other on the same clips of one talker, each as lively as the other.

python benchmarks/frontier.py CORPUS -o FOLDER [--fold 1] [--clips 50] [--variant both] [--rows lds tcn] [--device cuda] [--join]

Each of five folds tests a fifth of the sentences. Of the others a fifth says how much lips must be sharpened to move as recorded
(and which variant of `network_variants.py` is taken, of those that FOLDER holds for the fold), by models that learned from the
rest; those that are tested learned from all of them. FOLDER keeps networks and figures; `--join` prints the table over all folds
that are there, every clip tested once. Rows stand there as they come, and with lips closed at p, b and m by the same step for
all. Differences are tested clip by clip (Wilcoxon, Holm). `--clips`: learn from so many clips only, the first rows alone; of the
clips that this leaves over as many as else choose, by the models that are tested. With several such numbers `--join` prints the
curve as well. OMP_NUM_THREADS says how many threads learn.
"""

import argparse
import json
from collections.abc import Callable
from copy import deepcopy
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from time import perf_counter

import numpy as np
import torch
from frontier_table import Judge, Motions, join
from network_variants import VARIANTS, fewer, inner, kept, parts

from facesynth.config import load_config
from facesynth.corpus import Corpus, Utterance
from facesynth.evaluation.same_words import said_words, same_words
from facesynth.inference.filters import sharpen
from facesynth.inference.motion import Motion
from facesynth.inference.residual import ResidualMotion, loudness, main_emotion
from facesynth.inference.speech import Speech
from facesynth.methods.anime_graph.method import AnimeGraph
from facesynth.methods.efase.method import Efase
from facesynth.methods.efase.shares import PENALTY_S, learned_shares
from facesynth.methods.learn.expectation import COMPONENTS
from facesynth.methods.learn.frames import complete_frames
from facesynth.methods.learn.point_loss import lip_points
from facesynth.methods.learn.residual import Residual
from facesynth.methods.learn.sharpening import matching_share
from facesynth.methods.method import Method
from facesynth.methods.network.method import Network
from facesynth.methods.registry import create
from facesynth.motion.pca import Pca

CONFIGS = Path(__file__).parents[1] / "configs"
BY_COMPONENT = "eFASE soft by component"
Shares = tuple[tuple[float, ...], ...]
AS_IT_COMES = {"learn": False, "sharpening": 0.0}
REFERENCES = ("mean_face", "viseme_table", "phone_mean", "coarticulation", "ridge", "efase", "lds", "anime_graph", "tcn")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--fold", type=int, help="1 to 5; all unless given")
    parser.add_argument("--clips", type=int, help="how many to learn from; all unless given")
    parser.add_argument("--variant", choices=list(VARIANTS), help="of the network; the best that the folder holds unless given")
    parser.add_argument("--rows", nargs="+", metavar="ROW", help="only these, a search with its sharpened rows; all unless given")
    parser.add_argument("--plain", action="store_true", help="network and searches as they come alone, not sharpened")
    parser.add_argument("--device", default="cpu", help="where networks learn")
    parser.add_argument("--join", action="store_true", help="only print the tables of what is there")
    options = parser.parse_args()
    for fold in [] if options.join else [options.fold] if options.fold else range(1, 6):
        one_fold(Corpus.open(options.corpus), fold, options)
    if options.join or options.fold is None:
        join(options.output)


def one_fold(corpus: Corpus, fold: int, options: argparse.Namespace) -> None:
    """Figures of every row for the tested clips of a fold, kept in the folder."""
    began = perf_counter()
    rest, tested = parts(corpus, fold)
    learned, held_out = inner(rest, fold)
    if options.clips:  # those that are left over choose, and the models that are tested need no others beside them
        count = len(held_out)
        rest, spare = fewer(rest, fold, options.clips)
        learned, held_out = (rest, fewer(spare, fold, count)[0]) if len(spare) >= count else inner(rest, fold)
    variant = options.variant or best_variant(options.output, fold)
    stem = f"{fold}_{variant.replace(' ', '_')}" + (f"_{len(rest)}clips" if options.clips else "")
    print(f"fold {fold}, {len(rest)} clips, {variant}", flush=True)

    def network(some: Corpus, name: str) -> Network:
        return kept(options.output / f"{stem}_{name}.safetensors", some, VARIANTS[variant], 0, options.device)

    whole = network(rest, "whole")
    judge = Judge(rest, tested, whole.facts["closed_gap"], options.output / f"figures_{len(rest)}_{fold}.npz")
    makers = {
        "network": lambda net, _: net,
        "eFASE soft": soft_efase,
        "its search alone": search_alone,
        BY_COMPONENT: lambda net, some: showing(soft_efase(net, some), chosen_shares()),
        "network, raised by component": lambda net, _: Raised(net, *gains()),
        "anime graph soft": soft_graph,
    }

    @cache
    def chosen_shares() -> Shares:
        return learned_shares(soft_efase(network(learned, "0"), learned), held_out)

    @cache
    def gains() -> tuple[Pca, np.ndarray]:
        return raised_by(network(learned, "0"), learned, held_out)

    others = {} if options.clips else references(rest, tested, options.device)
    for row, speak in others.items():
        if row not in judge.rows and row in (options.rows or others):
            judge.add(row, speak())
            print(f"{perf_counter() - began:.0f} s, {fold}: {row} {judge.line(row)}", flush=True)
    for name, make in list(makers.items())[: 2 if options.clips else None]:
        last = name if options.plain else f"{name}, lips sharpened, residual"
        if last in judge.rows or name not in (options.rows or makers):
            continue
        model = make(whole, rest)
        plain = spoken(model, tested)
        found = {name: plain}
        if not options.plain:
            shares = shares_of(model if learned is rest else make(network(learned, "0"), learned), held_out)
            found[f"{name}, sharpened"] = lively(plain, tested, shares[1])
            found[last] = lively(plain, tested, shares[0], beside_lips(rest))
            print(f"{fold}: {name}: sharpened by {shares}")
        for row, motions in found.items():
            judge.add(row, motions)
            print(f"{perf_counter() - began:.0f} s, {fold}: {row} {judge.line(row)}", flush=True)


def beside_lips(learned: Corpus) -> ResidualMotion:
    """What moves beside the lips, as recorded."""
    residual = Residual()
    residual.learn(learned)
    motion = residual.motion(learned.fps, 1.0)
    assert motion is not None
    return motion


def best_variant(folder: Path, fold: int) -> str:
    """Of the variants in a folder the one of least lip error on the clips that a fold chooses by."""
    found = [json.loads(path.read_text()) for path in sorted(folder.glob(f"{fold}_*_0.json"))]
    found = [each for each in found if " ms" not in each["variant"] and "sound" not in each["variant"] and not each["steps"]]
    return min(found, key=lambda each: each["lve"])["variant"] if found else "both"


def shares_of(model: "Method | Raised", held_out: Corpus) -> tuple[float, float]:
    """How much is to be sharpened for lips, and for the whole face, to move as recorded."""
    pairs = [(model.synthesize(u.speech), u.motion) for u in held_out]
    return matching_share(pairs, lip_points(held_out.layout)), matching_share(pairs)


def spoken(model: "Method | Raised", some: Corpus) -> Motions:
    return {u.id: model.synthesize(u.speech) for u in some}


def lively(motions: Motions, tested: Corpus, share: float, beside: ResidualMotion | None = None) -> Motions:
    """Sharpened, and with what moves beside the lips."""
    made = {}
    for name, motion in motions.items():
        speech, frames = tested[name].speech, sharpen(motion.frames.astype(np.float64), share, motion.fps)
        if beside is not None:
            frames += beside.track(speech, main_emotion(speech, tested.emotions), motion.fps, len(motion))
        made[name] = Motion(frames.astype(np.float32), motion.fps, motion.layout)
    return made


def soft_efase(network: Network, learned: Corpus) -> Efase:
    """eFASE soft as it is before its weights are learned, not sharpened, which expects what the network does."""
    settings = {**load_config(CONFIGS / "efase_soft.yaml"), **AS_IT_COMES, "residual": 0.0, "maps": False}
    expecting = {name: settings[name] for name in ("pose_weight", "expected_share")}
    model = Efase.from_config({**settings, **dict.fromkeys(expecting, 0.0)}).fit(learned)
    model.audio.predictor = deepcopy(network.predictor)
    model.audio.predictor.answer_in(model.pca.encode)
    return model.with_weights(**expecting)


def showing(model: Efase, shares: Shares) -> Efase:
    """The same, of each component such shares of what the search finds and of what is expected."""
    model.set_shares(shares)
    return model


class Raised:
    """A network each of whose components is raised about the mean face."""

    def __init__(self, network: Network, pca: Pca, gains: np.ndarray) -> None:
        self.network, self.pca, self.gains = network, pca, gains

    def synthesize(self, speech: Speech) -> Motion:
        plain = self.network.synthesize(speech)
        more = (plain.frames - self.pca.mean.numpy()) @ self.pca.basis.numpy() * (self.gains - 1) @ self.pca.basis.numpy().T
        return replace(plain, frames=(plain.frames + more).astype(np.float32))


def raised_by(network: Network, learned: Corpus, held_out: Corpus) -> tuple[Pca, np.ndarray]:
    """Components, and by how much raising each brings a network nearest to recordings that it did not learn from."""
    pca = Pca.fit(complete_frames(learned), COMPONENTS)
    made, truth = [], []
    for u in held_out:
        plain = network.synthesize(u.speech).frames
        count = min(len(plain), len(u.motion))
        there = np.isfinite(u.motion.frames[:count]).all(axis=1)
        for list_, frames in ((made, plain), (truth, u.motion.frames)):
            list_.append(pca.encode(torch.from_numpy(frames[:count][there])).numpy())
    x, y = np.concatenate(made).astype(np.float64), np.concatenate(truth)
    more = (x * (y - x)).sum(axis=0) / ((1 + PENALTY_S * learned.fps / len(x)) * np.square(x).sum(axis=0))
    return pca, 1 + more


def search_alone(network: Network, learned: Corpus) -> Efase:
    """The same, none of what is shown being the expected pose."""
    return soft_efase(network, learned).with_weights(expected_share=0.0)


def soft_graph(network: Network, learned: Corpus) -> AnimeGraph:
    """The same of the anime graph."""
    settings = {**load_config(CONFIGS / "anime_graph_soft.yaml"), **AS_IT_COMES}
    model = AnimeGraph.from_config({**settings, "pose_weight": 0.0}).fit(learned)
    model.config["pose_weight"] = settings["pose_weight"]
    model.predictor = deepcopy(network.predictor)
    model.predictor.answer_in(model.in_metric)
    return model


def references(learned: Corpus, tested: Corpus, device: str) -> dict[str, Callable[[], Motions]]:
    """What makes the rows of the others, on the same clips."""

    def again() -> Motions:
        others = [word for name in learned.ids for word in said_words(learned, name)]
        return {u.id: same_words(u, said_words(tested, u.id), learned, others) for u in tested}

    def of(name: str) -> Motions:
        model = create(name, **({"maps": False} if name == "efase" else {}))
        return spoken(model.to(device if name == "tcn" else "cpu").fit(learned).to("cpu"), tested)

    recorded = {u.id: u.motion for u in tested}
    own = {"recorded": lambda: recorded, "same word again": again, "loudness": partial(by_loudness, learned, tested)}
    return own | {name: partial(of, name) for name in REFERENCES}


def by_loudness(learned: Corpus, tested: Corpus) -> Motions:
    """Poses along one line, as far as the sound is loud: what a jaw does that follows the level alone."""
    pairs = [(loudness(u.speech, u.motion.fps, len(u.motion)), u.motion.frames) for u in learned]
    heard, moved = (np.concatenate([pair[k] for pair in pairs]) for k in (0, 1))
    there = np.isfinite(moved).all(axis=1)
    line = np.linalg.lstsq(np.c_[heard, np.ones(len(heard))][there], moved[there], rcond=None)[0]

    def pose(u: Utterance) -> Motion:
        level = loudness(u.speech, learned.fps, len(u.motion))
        return Motion((np.c_[level, np.ones(len(level))] @ line).astype(np.float32), learned.fps, learned.layout)

    return {u.id: pose(u) for u in tested}


if __name__ == "__main__":
    main()
