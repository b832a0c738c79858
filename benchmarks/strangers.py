"""A talker's models driven by other voices.

python benchmarks/strangers.py CORPUS STRANGERS [RECORDINGS] [--kept FOLDER] [--rows ROW …]

Each row learns from four fifths of CORPUS (the first of `frontier.py`'s folds) and says clips of the last fifth, then all of
STRANGERS, a corpus of somebody else in the same layout, and the `ravdess_speech` of RECORDINGS, sounds of people whose lips
nobody followed. Printed are the lip error on the talker's own unseen clips (`lve`, unit of the layout); for STRANGERS the mean
correlation over clips of the lip opening with that of the speaker's own lips, from the first to the last phone and over whole
clips; for RECORDINGS the shares of p, b and m and of open vowels (placed by the known words) at which the lips shut, below the
opening that nine tenths of the talker's own p, b and m stay below; all with the words known and with phones heard in the sound.
Soft searches expect what the network of the same features does, are not sharpened, and have the weights from which learning
starts. Networks are kept in FOLDER and not learned again. `--device` says where they are trained.
"""

import argparse
import sys
from collections.abc import Callable, Mapping
from copy import deepcopy
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import process_time
from typing import Any
from unittest.mock import patch

import numpy as np
import torch
from closures import ravdess
from frontier import soft_efase, soft_graph
from models_for_strangers import correlation, cut, lips_of, spoken, unknown
from network_variants import Variant, kept, of_sound, parts

from facesynth.corpus import Corpus, Utterance
from facesynth.device import device_of
from facesynth.evaluation.geometry import lve
from facesynth.evaluation.lips import OPEN_VOWELS, closure_rate, closure_threshold, false_closure_rate, lip_opening
from facesynth.inference.motion import Motion
from facesynth.inference.phones import BILABIALS
from facesynth.inference.speech import PhoneTrack, Speech
from facesynth.methods.learn.hearing import WIDTHS, Hearing
from facesynth.methods.method import Method
from facesynth.methods.network.method import Network
from facesynth.methods.registry import create
from facesynth.motion.resample import resample
from facesynth.speech.hearing import hear

FOLD = 1
VOICES = {"phone_net": 8}
"""Changed sounds that the network learns from as well, by features; none where nothing is said."""
SEARCHES: dict[str, tuple[Callable[[Network, Corpus], Any], Callable[[Any], tuple[Any, Any]]]] = {
    "eFASE soft": (soft_efase, lambda model: (model.audio, model.pca.encode)),
    "anime graph soft": (soft_graph, lambda model: (model, model.in_metric)),
}
"""How each is made, and where it keeps the network and in which coordinates it asks it."""
CHANGED = "network, both, 8 voices"
PLAIN = ("viseme_table", "coarticulation", "efase", "anime_graph")
HEADS = (
    "own lip error",
    "in speech, words known",
    "nothing known",
    "whole clip, words known",
    "nothing known",
    "shut at p, b, m, words known",
    "nothing known",
    "at open vowels, words known",
    "nothing known",
)


@dataclass(frozen=True)
class Learner:
    """What a row's model is made with."""

    learned: Corpus
    kept: Path
    device: str
    searches: dict[str, Method] = field(default_factory=dict)

    def method(self, name: str, settings: Mapping[str, Any]) -> Method:
        """As it is shipped."""
        return create(name, **settings).to(device_of(self.device)).fit(self.learned, seed=0).cpu()

    def network(self, features: str) -> Network:
        """The network of poses that hears so, from the folder or newly learned."""
        variant = Variant({"features": features, "voices": VOICES.get(features, 0)})
        return self.variant(f"network, {features}", variant)

    def variant(self, name: str, variant: Variant) -> Network:
        """The network that is trained so, from the folder or newly learned."""
        return kept(self.kept / f"{name}.safetensors", self.learned, variant, 0, self.device)

    def soft(self, name: str, features: str) -> Method:
        """A search that expects what that network does; its nodes are the same whatever is heard, and learned once."""
        search, place = SEARCHES[name]
        network = deepcopy(self.network(features))
        if name not in self.searches:
            self.searches[name] = search(network, self.learned)
        model = deepcopy(self.searches[name])
        holder, encode = place(model)
        holder.predictor = network.predictor
        holder.predictor.answer_in(encode)
        return model


@dataclass(frozen=True)
class Heard:
    """A sound of somebody whose words are known."""

    speech: Speech
    unknown: Speech
    """The same, of which nobody knows them."""


def rows(learner: Learner) -> dict[str, Callable[[], Method]]:
    """What makes each row's model."""
    made: dict[str, Callable[[], Method]] = {name: lambda name=name: learner.method(name, {}) for name in PLAIN}
    for hears in ("periodogram", *WIDTHS):
        made[f"lds, {hears}"] = lambda hears=hears: learner.method("lds", {"hears": hears})
    for features in WIDTHS:
        for name in ("ridge", "tcn"):
            made[f"{name}, {features}"] = lambda name=name, features=features: learner.method(name, {"features": features})
        made[f"network, {features}"] = lambda features=features: learner.network(features)
        for name in SEARCHES:
            made[f"{name}, {features}"] = lambda name=name, features=features: learner.soft(name, features)
    changed = Variant({"features": "both", "voices": VOICES["phone_net"]})
    made[CHANGED] = lambda: learner.variant(CHANGED, changed)
    return made


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("strangers", type=Path)
    parser.add_argument("recordings", type=Path, nargs="?", help="a folder that has `ravdess_speech`")
    parser.add_argument("--kept", type=Path, default=Path("strangers"), metavar="FOLDER", help="of networks")
    parser.add_argument("--rows", nargs="+", metavar="ROW", help="all unless given")
    parser.add_argument("--own", type=int, default=40, help="unseen clips of the talker that are said")
    parser.add_argument("--voices", type=int, default=20, help="sounds of the recordings, taken evenly")
    parser.add_argument("--errors", type=Path, metavar="FILE", help="where lines `row,clip,lip error` are added")
    parser.add_argument("--device", default="cpu")
    options = parser.parse_args()
    torch.set_num_threads(1)
    learned, unseen = parts(Corpus.open(options.corpus), FOLD)
    own = [unseen[name] for name in unseen.ids[: options.own]]
    said = list(Corpus.open(options.strangers))
    heard = [replace(u, speech=unknown(u.speech)) for u in said]
    voices = voices_of(options.recordings, options.voices) if options.recordings else []
    shut = closure_threshold((u.motion, u.speech.phones) for u in learned)
    makers = rows(Learner(learned, options.kept, options.device))
    print(f"| | {' | '.join(HEADS)} |\n|---" + len(HEADS) * "|---:" + "|", flush=True)
    with patch.object(Hearing, "of_sound", of_sound):
        for name in options.rows or makers:
            began = process_time()
            model = makers[name]()
            errors = [lip_error(model, u) for u in own]
            if options.errors:
                with options.errors.open("a", encoding="utf-8") as file:
                    file.writelines(f'"{name}",{u.id},{error:.5f}\n' for u, error in zip(own, errors, strict=True))
            error = np.nanmean(errors)
            figures = (*followed(model, said, heard), *shuts(model, voices, shut))
            print(f"| {name} | {error:.3f} | {' | '.join(f'{figure:.3f}' for figure in figures)} |", flush=True)
            print(f"{name}: {process_time() - began:.0f} s of processor time", file=sys.stderr, flush=True)


def voices_of(recordings: Path, count: int) -> list[Heard]:
    """Sounds of RAVDESS, taken evenly; all are said neutrally."""
    found = ravdess(recordings)
    count = min(count, len(found))
    speeches = [hear(path, text=text).speech for path, text, _ in (found[i * len(found) // count] for i in range(count))]
    return [Heard(speech, unknown(speech)) for speech in speeches]


def lip_error(model: Method, utterance: Utterance) -> float:
    """Of a clip of the talker's own."""
    made = resample(model.synthesize(utterance.speech), utterance.motion.fps)
    count = min(len(made), len(utterance.motion))
    return lve(replace(made, frames=made.frames[:count]), replace(utterance.motion, frames=utterance.motion.frames[:count]))


def followed(model: Method, said: list[Utterance], heard: list[Utterance]) -> tuple[float, ...]:
    """The four correlations."""
    truth = [lips_of(lip_opening(u.motion), u.motion.fps) for u in said]

    def opening(speech: Speech) -> tuple[Any, float]:
        motion: Motion = model.synthesize(speech)
        return lip_opening(motion), motion.fps

    known, unknown_ = spoken(opening, said), spoken(opening, heard)
    inside = [correlation(cut(made, said), cut(truth, said)) for made in (known, unknown_)]
    return (*inside, correlation(known, truth), correlation(unknown_, truth))


def shuts(model: Method, voices: list[Heard], shut: float) -> tuple[float, ...]:
    """Shares of closures and of open vowels at which lips are shut; each with the words known, and not."""
    ways = [(one, one.speech) for one in voices], [(one, one.unknown) for one in voices]
    made = [[(model.synthesize(speech), one.speech.phones) for one, speech in way] for way in ways]
    return tuple(share(each, kind, shut) for kind in (BILABIALS, OPEN_VOWELS) for each in made)


def share(made: list[tuple[Motion, PhoneTrack]], kind: frozenset[str], shut: float) -> float:
    """Of the phones of a kind that all say together."""
    rate = closure_rate if kind is BILABIALS else false_closure_rate
    counts = [sum(label in kind for label in phones.labels) for _, phones in made]
    met = sum(count * rate(motion, phones, shut) for count, (motion, phones) in zip(counts, made, strict=True) if count)
    return met / sum(counts) if sum(counts) else np.nan


if __name__ == "__main__":
    main()
