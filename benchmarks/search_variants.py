"""What might let a search add more to the pose that it expects: one change at a time.

python benchmarks/search_variants.py CORPUS -o FOLDER [--fold 1] [--variants …]

FOLDER is that of `frontier.py --variant both`, whose networks are taken (and learned where they are not there). On the clips that
a fold chooses by: lip error (mm) and energy as it comes, and lip error with lips sharpened until they move as recorded; of the
search alone, and of the mean of what it shows and what is expected (`expected_share`).
"""

import argparse
from collections.abc import Callable, Iterator, Mapping
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from unittest.mock import patch

import numpy as np
import torch
from expected_shares import near
from frontier import lively, soft_efase
from frontier_table import Motions
from network_variants import VARIANTS, inner, kept, parts
from search_certainty import CertainHearing, Certainty

from facesynth.corpus import Corpus, node_name
from facesynth.inference.efase.model import Efase as Speaker
from facesynth.inference.efase.plan import Plan
from facesynth.inference.expectation import Said
from facesynth.methods.efase.audio import PhoneSound
from facesynth.methods.efase.method import Efase
from facesynth.methods.efase.shares import learned_shares
from facesynth.methods.learn.expectation import PosePredictor
from facesynth.methods.learn.linear_path import LinearPath
from facesynth.methods.learn.point_loss import lip_points
from facesynth.methods.learn.sharpening import matching_share
from facesynth.methods.network.method import Network

SHARES = (0.0, 0.5)
"""Of the expected pose in what is shown."""
CERTAINTIES = {
    "weighed by component": Certainty(moments=False),
    "by component and moment": Certainty(),
    "by component and moment, by the deviation": Certainty(power=0.5),
    "by moment": Certainty(components=False),
    "by component and moment, beyond the spread of poses": Certainty(beyond_spread=True),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--fold", type=int, default=1)
    parser.add_argument("--device", default="cpu", help="where networks learn")
    parser.add_argument("--variants", nargs="+", choices=list(TRIED), default=list(TRIED), metavar="NAME")
    options = parser.parse_args()
    trial = Trial.of(Corpus.open(options.corpus), options.fold, options.output, options.device)
    print("| fold | search | lip error (energy) | sharpened |\n|---:|---|---:|---:|", flush=True)
    for name in options.variants:
        for what, motions in TRIED[name](trial):
            error, energy = near(motions, trial.held_out)
            share = matching_share([(motions[u.id], u.motion) for u in trial.held_out], lip_points(trial.held_out.layout))
            raised = near(lively(motions, trial.held_out, share), trial.held_out)[0]
            print(f"| {options.fold} | {what} | {error:.4f} ({energy:.2f}) | {raised:.4f} |", flush=True)


@dataclass(frozen=True, eq=False)
class Trial:
    """What a fold chooses by: recordings, networks and a search that expects what they do."""

    learned: Corpus
    held_out: Corpus
    network: Network
    others: Callable[[], Mapping[str, Network]]
    """By utterance of `learned` a network of another fold, which did not learn from it."""

    @classmethod
    def of(cls, corpus: Corpus, fold: int, folder: Path, device: str) -> "Trial":
        def network(fold: int, name: str, some: Corpus) -> Network:
            return kept(folder / f"{fold}_both_{name}.safetensors", some, VARIANTS["both"], 0, device)

        def others() -> Mapping[str, Network]:
            found = {}
            for other in {1, 2, 3, 4, 5} - {fold}:
                rest, tested = parts(corpus, other)
                found |= dict.fromkeys(tested.ids, network(other, "whole", rest))
            return found

        learned, held_out = inner(parts(corpus, fold)[0], fold)
        return cls(learned, held_out, network(fold, "0", learned), others)

    @cached_property
    def model(self) -> Efase:
        """eFASE soft as `frontier.py` has it."""
        return soft_efase(self.network, self.learned)


Rows = Iterator[tuple[str, Motions]]


def shown(what: str, speaker: Speaker, held_out: Corpus) -> Rows:
    """The search alone, and the mean of it and of what it expects."""
    plans = {u.id: speaker.plans(u.speech) for u in held_out}
    for share in SHARES:
        speaker.settings = replace(speaker.settings, expected_share=share)
        name = what if share == 0 else f"{what}, half expected"
        yield name, {u.id: speaker.moved(u.speech, plans[u.id]) for u in held_out}


def as_it_is(trial: Trial) -> Rows:
    yield from shown("as it is", trial.model.speaker, trial.held_out)


def weighed(trial: Trial) -> Rows:
    """Differences from the expected pose count by how sure the network is of it."""
    speaker, predictor = trial.model.speaker, trial.model.audio.predictor
    assert predictor is not None
    assert speaker.hearing is not None
    for what, certainty in CERTAINTIES.items():
        hearing = CertainHearing.of(speaker.hearing, predictor, certainty, trial.learned)
        yield from shown(what, Speaker(replace(speaker.parts, hearing=hearing)), trial.held_out)


def more_candidates(trial: Trial) -> Rows:
    yield from shown("150 candidates in place of 60", trial.model.with_weights(candidates=150).speaker, trial.held_out)


def other_weights(trial: Trial) -> Rows:
    """The expected pose counts more or less in the cost, and dear paths in the mean."""
    for pose, temperature in ((0.5, 1.0), (1.0, 0.5), (1.0, 2.0), (2.0, 1.0), (2.0, 2.0), (4.0, 1.0)):
        model = trial.model.with_weights(pose_weight=pose, temperature=temperature)
        yield from shown(f"pose_weight {pose:g}, temperature {temperature:g}", model.speaker, trial.held_out)


def longer_pieces(trial: Trial) -> Rows:
    penalty = 2 * trial.model.config["penalty"]
    yield from shown("leaving a recording costs twice as much", trial.model.with_weights(penalty=penalty).speaker, trial.held_out)


def by_ear(trial: Trial) -> Rows:
    """Nodes are chosen by how they sounded, too: bands and the phone network's layer."""
    model = trial.model.with_weights()
    model.audio.sound = PhoneSound("both")
    model.audio.sound.learn(trial.learned, tuple(model.facts["names"]), model.nodes().phones)
    for weight in (1.0, 3.0):
        speaker = model.with_weights(audio_weight=weight).speaker
        yield from shown(f"how nodes sounded counts {weight:g}", speaker, trial.held_out)


def by_expectation(trial: Trial) -> Rows:
    """Searches that expect what the network, the regression and both say, and the mean of the three."""
    found = []
    for share in (0.0, 1.0, None):
        with patch.object(LinearPath, "share", LinearPath.share if share is None else share):
            what = "both" if share is None else "the regression" if share else "the network"
            speaker = Speaker(trial.model.speaker.parts)
            rows = list(shown(f"what {what} says is expected", speaker, trial.held_out))
        found.append(rows)
        yield from rows if share is not None else ()
    for k, what in enumerate(("mean of the three", "mean of the three, half expected")):
        means = [{name: one.frames for name, one in rows[k][1].items()} for rows in found]
        yield what, {name: replace(one, frames=sum(m[name] for m in means) / 3) for name, one in found[0][k][1].items()}


def differences(trial: Trial) -> Rows:
    """Around what is expected, what recordings differ by from what a network expected that did not learn from them.

    They are chosen as poses, by the search as it is, or as differences: the cheapest joins and the smallest ones.
    """
    speaker, model = trial.model.speaker, of_differences(trial)
    around = Around(replace(model.speaker.parts, hearing=None))
    for what, chooser in {"chosen as poses": speaker, "chosen as differences": model.speaker}.items():
        plans = {}
        for u in trial.held_out:
            expected = speaker.plan(u.speech).expected
            plans[u.id] = [replace(plan, expected=expected) for plan in chooser.plans(u.speech)]
        for share in (1.0, 0.5, 0.25):
            around.share = share
            yield f"differences {what}, {share:g} of them", {u.id: around.moved(u.speech, plans[u.id]) for u in trial.held_out}


class Around(Speaker):
    """Shows recorded differences around what is expected; lips are not closed further."""

    share = 1.0

    def coordinates(self, plan: Plan, *about: object) -> np.ndarray:  # type: ignore[override]
        assert plan.expected is not None
        return plan.expected + self.share * super().coordinates(replace(plan, expected=None), *about)  # type: ignore[arg-type]

    def _closures(self, plan: Plan, labels: object) -> np.ndarray:
        return np.full(len(plan.nodes), np.nan)


def of_differences(trial: Trial) -> Efase:
    """The same database whose nodes are differences, of which the likeliest is none."""
    model = trial.model.with_weights()
    nodes, others, fps = model.nodes(), trial.others(), model.config["database_fps"]
    numbers = {name: k for k, name in enumerate(model.facts["names"])}
    frames = nodes.frames.copy()
    for u in trial.learned:
        predictor = in_coordinates(others[u.id].predictor, model)
        bounds = u.speech.phones.frame_bounds(fps)
        heard = predictor.hearing.bands(u.speech)
        expected = predictor.expectation().poses(heard, Said.of(u.speech, trial.learned.emotions), fps, int(bounds[-1]))
        for t in range(len(u.speech.phones)):
            if (k := numbers.get(node_name(u.id, t))) is not None:
                frames[nodes.starts[k] : nodes.stops[k]] -= expected[bounds[t] : bounds[t + 1]].astype(frames.dtype)
    model.register_buffer("node_frames", torch.from_numpy(frames))
    model.register_buffer("rest", torch.zeros_like(model.rest))
    model = model.with_weights()
    model.audio = deepcopy(model.audio)
    none = model.audio.predictor
    assert none is not None
    none.into, none.onto, none.linear = torch.zeros_like(none.into), torch.zeros_like(none.onto), LinearPath()
    return model


def in_coordinates(predictor: PosePredictor, model: Efase) -> PosePredictor:
    """The same, told in a model's coordinates."""
    other = deepcopy(predictor)
    other.answer_in(model.pca.encode)
    return other


def by_component(trial: Trial) -> Rows:
    """Shares of search and expected pose for each component, learned on one half of the clips and shown on the other."""
    some, made = list(trial.held_out), {}
    for learned, others in ((some[::2], some[1::2]), (some[1::2], some[::2])):
        model = trial.model.with_weights(expected_share=SHARES[1])
        model.set_shares(learned_shares(model, learned))
        made |= {u.id: model.synthesize(u.speech) for u in others}
    yield "shares by component, chosen on the other half of the clips", made


TRIED: dict[str, Callable[[Trial], Rows]] = {
    "as it is": as_it_is,
    "certainty": weighed,
    "candidates": more_candidates,
    "longer": longer_pieces,
    "weights": other_weights,
    "ear": by_ear,
    "expectations": by_expectation,
    "differences": differences,
    "shares": by_component,
}


if __name__ == "__main__":
    main()
