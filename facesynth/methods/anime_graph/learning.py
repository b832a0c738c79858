"""Weights of the cost of the anime graph, learned by gradient through the mean over paths; see `learn.descent`.

As in eFASE the mean is differentiable in every cost, and so is its distance to recordings that the graph does not have.
Learned are the weights of jumps, of their size, of the sound and of the expected pose; the temperature is what they are
measured by and stays. How much the mean must be sharpened is taken from the sentences that say when to stop.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from facesynth.corpus import Corpus, Utterance
from facesynth.inference.anime_graph.candidates import stretched_motions
from facesynth.inference.anime_graph.plan import lay_steps
from facesynth.inference.anime_graph.search import Weights, step_terms
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion
from facesynth.methods.learn.descent import Learned, Logs, descend, squared_error, three_parts, with_gaps
from facesynth.methods.learn.sharpening import matching_share
from facesynth.methods.learn.spreading import in_pieces
from facesynth.motion.search.posterior import posterior
from facesynth.motion.search.steps import GivenSteps

if TYPE_CHECKING:
    from facesynth.methods.anime_graph.method import AnimeGraph

NUMBERS = ("jump_weight", "jump_cost_weight", "audio_weight", "pose_weight")
CANDIDATES = 80
"""Nodes of each phone that take part in learning; synthesis knows no such limit."""


@dataclass(frozen=True, eq=False)
class Lattice:
    """One utterance of P phones with n_t candidates each."""

    audio: Sequence[Tensor]
    """P of [n] audio costs."""
    pose: Sequence[Tensor]
    """P of [n] pose costs."""
    motion: Sequence[Tensor]
    """P of [n, L, D] each candidate, stretched evenly to the phone, as components times metric."""
    jumps: Sequence[Tensor]
    """P - 1 of [n, n'] 1 where a step is a jump."""
    apart: Sequence[Tensor]
    """P - 1 of [n, n'] distance of the frames that meet there."""
    truth: Tensor
    """[T, D] what was recorded, NaN in gaps."""


def learn(corpus: Corpus, settings: Mapping[str, Any], *, seed: int = 0, rounds: int = 20, pull: float = 0.02) -> Learned:
    """Learn on sentences that the graph does not have; `pull` weighs the way from the start against the relative error.

    `settings` are those of `AnimeGraph`, with a temperature above 0. A sharpening above 0 is learned as well.
    """
    from facesynth.methods.anime_graph.method import AnimeGraph  # which calls this

    if not settings.get("temperature", 0) > 0:
        raise FacesynthError("learning goes through the mean over paths; give a temperature above 0 (2 is a start)")
    graph, *held_out = three_parts(corpus, seed)
    model = AnimeGraph.from_config(settings).fit(graph, seed=seed)
    ids, count = [number for part in held_out for number in part.ids], len(held_out[0])
    lattices = list(in_pieces(partial(_lattice, model, corpus), ids, "lattices"))
    examples, others = lattices[:count], lattices[count:]
    logs, temperature = Logs({name: model.config[name] for name in NUMBERS}, {}), model.config["temperature"]
    errors = descend(
        logs, lambda some, numbers: mean_error(some, numbers, temperature), examples, others, seed=seed, rounds=rounds, pull=pull
    )
    found = logs.found()
    if model.config["sharpening"] > 0:
        say = partial(_made_and_recorded, model, Weights(*(found[name] for name in NUMBERS)), held_out[1])
        found["sharpening"] = matching_share(list(in_pieces(say, held_out[1].ids, "sharpening")))
    return Learned(found, errors)


def mean_error(lattices: Sequence[Lattice], logs: Logs, temperature: float) -> Tensor:
    """Mean over frames of ‖posterior mean - truth‖², differentiable in the weights."""
    total, count, values = torch.zeros((), dtype=torch.float64), 0, logs.values()
    for lattice in lattices:
        moves = zip(lattice.jumps, lattice.apart, strict=True)
        heard = zip(lattice.audio, lattice.pose, strict=True)
        targets = [(values["audio_weight"] * audio + values["pose_weight"] * pose)[None] for audio, pose in heard]
        steps = [(values["jump_weight"] * jumps + values["jump_cost_weight"] * apart).mT for jumps, apart in moves]
        found = posterior(targets, GivenSteps(steps), temperature)
        means = [torch.tensordot(shares[0], motion, 1) for shares, motion in zip(found.nodes, lattice.motion, strict=True)]
        error, frames = squared_error(torch.cat(means), lattice.truth)
        total, count = total + error, count + frames
    return total / max(count, 1)


def _lattice(model: AnimeGraph, corpus: Corpus, number: str) -> Lattice:
    return lattice_of(model, corpus[number])


def _made_and_recorded(model: AnimeGraph, weights: Weights, corpus: Corpus, number: str) -> tuple[Motion, Motion]:
    """What the model makes of a recorded speech by these weights, not sharpened, and the recording."""
    utterance = corpus[number]
    return replace(model.runtime(), weights=weights, sharpening=0.0).synthesize(utterance.speech), utterance.motion


def lattice_of(model: AnimeGraph, utterance: Utterance) -> Lattice:
    """Of one recorded utterance, the CANDIDATES of each phone that cost least by themselves under the model's weights."""
    runtime = model.runtime()
    wishes, metric, chooser = runtime.wishes(utterance.speech), runtime.metric, runtime.chooser
    candidates, steps = lay_steps(chooser, wishes, metric)
    kept = [np.sort(np.argsort(runtime.weights.target(step), kind="stable")[:CANDIDATES]) for step in steps]
    count = sum(wish.frames for wish in wishes)
    some = [replace(c, nodes=c.nodes[k], maps=c.maps[k]) for c, k in zip(candidates, kept, strict=True)]
    terms = [[x[np.ix_(i, j)] for x in step_terms(a, b)] for (a, b), (i, j) in zip(pairwise(steps), pairwise(kept), strict=True)]
    return Lattice(
        _tensors(step.audio[k] for step, k in zip(steps, kept, strict=True)),
        _tensors(np.zeros(len(k)) if step.pose is None else step.pose[k] for step, k in zip(steps, kept, strict=True)),
        _tensors(stretched_motions(chooser, c, w.frames) @ metric for c, w in zip(some, wishes, strict=True)),
        _tensors(jumps for jumps, _ in terms),
        _tensors(apart for _, apart in terms),
        with_gaps(model.in_metric(torch.from_numpy(utterance.motion.frames)), count),
    )


def _tensors(arrays: Iterable[NDArray[np.float64]]) -> list[Tensor]:
    return [torch.from_numpy(np.ascontiguousarray(array, np.float64)) for array in arrays]
