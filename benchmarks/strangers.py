"""A talker's models driven by another talker's voice: `python benchmarks/strangers.py CORPUS STRANGERS [--rows …] [--own 12]`.

Each row learns from four fifths of CORPUS, drawn by seed 0, and says clips of the last fifth of it and all of STRANGERS, a corpus
of somebody else in the same layout. Printed are the lip error on the talker's own unseen clips (`lve`, unit of the layout), and
for strangers the mean correlation over clips of the lip opening with that of the speaker's own lips, from the first to the last
phone and over whole clips, with the words known and with phones heard in the sound. `--device` says where networks are trained.
"""

import argparse
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from models_for_strangers import correlation, cut, lips_of, spoken, unknown

from facesynth.config import load_config
from facesynth.corpus import Corpus, Utterance
from facesynth.device import device_of
from facesynth.evaluation.geometry import lve
from facesynth.evaluation.lips import lip_opening
from facesynth.inference.motion import Motion
from facesynth.methods.learn.hearing import WIDTHS
from facesynth.methods.method import Method
from facesynth.methods.registry import create
from facesynth.motion.resample import resample

CONFIGS = Path(__file__).parent.parent / "configs"
VOICES = 8
SOFT = {"learn": False}
"""Their weights as they are shipped."""


def rows() -> dict[str, tuple[str, Mapping[str, Any]]]:
    """Methods and their settings, by the names of rows."""
    plain = {name: (name, {}) for name in ("viseme_table", "coarticulation", "efase", "anime_graph", "lds")}
    soft = {
        f"{method} soft, {features}": (method, {**settings, "features": features, "voices": VOICES * (features != "log_mel")})
        for method, settings in ((name, load_config(CONFIGS / f"{name}_soft.yaml") | SOFT) for name in ("efase", "anime_graph"))
        for features in WIDTHS
    }
    heard = {f"{method}, {features}": (method, {"features": features}) for method in ("ridge", "tcn") for features in WIDTHS}
    network = {
        f"network, {features}, {voices} voices": ("network", {"features": features, "voices": voices})
        for features in WIDTHS
        for voices in (0, VOICES)
    }
    return plain | soft | heard | network


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("strangers", type=Path)
    parser.add_argument("--rows", nargs="+", default=list(rows()), metavar="ROW", help="; ".join(rows()))
    parser.add_argument("--own", type=int, default=12, help="unseen clips of the talker that are said")
    parser.add_argument("--device", default="cpu")
    options = parser.parse_args()
    torch.set_num_threads(1)
    corpus = Corpus.open(options.corpus)
    order = [corpus.ids[k] for k in np.random.default_rng(0).permutation(len(corpus))]
    learned, unseen = order[: len(order) * 4 // 5], order[len(order) * 4 // 5 :][: options.own]
    said = list(Corpus.open(options.strangers))
    heard = [replace(u, speech=unknown(u.speech)) for u in said]
    print("| | own lip error | in speech, words known | nothing known | whole clip, words known | nothing known |")
    print("|---|---:|---:|---:|---:|---:|")
    for name in options.rows:
        method, settings = rows()[name]
        settings = {key: value for key, value in settings.items() if key != "device"}
        model = create(method, **settings).to(device_of(options.device)).fit(corpus.subset(learned), seed=0).cpu()
        own = np.nanmean([error(model, corpus[i]) for i in unseen])
        print(f"| {name} | {own:.3f} | {judged(model, said, heard)} |", flush=True)


def error(model: Method, utterance: Utterance) -> float:
    """Lip error of a clip of the talker's own."""
    made = resample(model.synthesize(utterance.speech), utterance.motion.fps)
    count = min(len(made), len(utterance.motion))
    return lve(replace(made, frames=made.frames[:count]), replace(utterance.motion, frames=utterance.motion.frames[:count]))


def judged(model: Method, said: list[Utterance], heard: list[Utterance]) -> str:
    """The four correlations."""
    truth = [lips_of(lip_opening(u.motion), u.motion.fps) for u in said]

    def opening(speech: Any) -> tuple[Any, float]:
        motion: Motion = model.synthesize(speech)
        return lip_opening(motion), motion.fps

    known, unknown_ = spoken(opening, said), spoken(opening, heard)
    inside = [correlation(cut(made, said), cut(truth, said)) for made in (known, unknown_)]
    return " | ".join(f"{figure:.3f}" for figure in (*inside, correlation(known, truth), correlation(unknown_, truth)))


if __name__ == "__main__":
    main()
