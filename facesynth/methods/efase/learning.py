"""Weights of the cost, and a linear metric of sound and of expected pose, learned by gradient through the soft search.

The posterior mean is differentiable in every cost (see `soft`), so its squared distance to recordings that are not in
the database is too. What is learned: PNT, a1 … a6, the two audio weights, the temperature, and one factor for each
component of the sound and of the expected pose, as `descent` tells; then how much of each component is shown as found
and as expected (`shares`); and, on the sentences that say when to stop, how much the mean must be sharpened to move as
quickly as they do.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from itertools import chain, pairwise
from typing import Any

import numpy as np
import torch
from torch import Tensor

from facesynth.corpus import Corpus, Utterance
from facesynth.inference.arrays import Floats, Ints
from facesynth.inference.efase.costs import Query, all_targets
from facesynth.inference.efase.nodes import Nodes
from facesynth.inference.efase.plan import stretches
from facesynth.inference.efase.soft import candidates
from facesynth.inference.efase.steps import StepTerms, step_terms
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion
from facesynth.inference.warp import stretched
from facesynth.methods.efase.method import Efase
from facesynth.methods.efase.penalty import median_transition
from facesynth.methods.efase.shares import learned_shares
from facesynth.methods.learn.descent import Learned, Logs, descend, squared_error, three_parts, with_gaps
from facesynth.methods.learn.point_loss import lip_points
from facesynth.methods.learn.sharpening import matching_share
from facesynth.methods.learn.spreading import in_pieces
from facesynth.motion.resample import resample
from facesynth.motion.search.posterior import posterior
from facesynth.motion.search.steps import GivenSteps
from facesynth.progress import track

NUMBERS = ("pnt", "alpha", "beta", "eta", "gamma", "delta", "phi", "audio_weight", "pose_weight", "temperature")


@dataclass(frozen=True)
class LearnedMetrics(Learned):
    """What learning found, with a factor for each component."""

    sound_metric: tuple[float, ...]
    pose_metric: tuple[float, ...]
    shares: tuple[tuple[float, ...], ...] = ()
    """Of what is found and of what is expected; none where nothing expected is shown."""

    @property
    def account(self) -> dict[str, Any]:
        """What a trained model remembers of it, and the metrics and shares that it is to use."""
        lists = {"sound_metric": list(self.sound_metric), "pose_metric": list(self.pose_metric)}
        return super().account | lists | {"shares": [list(share) for share in self.shares]}


@dataclass(frozen=True, eq=False)
class Place:
    """What the target cost and the mean depend on at one phone with n candidates."""

    other: Tensor
    """[n] 1 for another phone of another viseme class."""
    sibling: Tensor
    """[n] 1 for another phone of the same viseme class."""
    feeling: Tensor
    """[n] 1 for another emotion."""
    sound: Tensor
    """[n, A] squared differences of the sound."""
    pose: Tensor
    """[n, D] squared differences from the expected pose."""
    motion: Tensor
    """[n, L, D] each candidate, stretched to the phone."""


@dataclass(frozen=True, eq=False)
class Lattice:
    """One stretch of speech: P phones and the steps between them."""

    places: Sequence[Place]
    steps: Sequence[StepTerms]
    truth: Tensor
    """[T, D] what was recorded, NaN in gaps."""


def logs_of(model: Efase) -> Logs:
    """What is learned of a model, where it stands: the numbers NUMBERS, and factors of `sound` [A] and `pose` [D]."""
    weights = model.weights()
    audio_weight, pose_weight = model.audio_weights()
    numbers = {name: getattr(weights, name) for name in NUMBERS[:7]}
    numbers |= {"audio_weight": audio_weight, "pose_weight": pose_weight, "temperature": model.temperature}
    sound = 0 if model.audio.sound is None else len(model.audio.sound.size)
    pose = 0 if model.audio.predictor is None else len(model.audio.predictor.metric)
    return Logs(numbers, {"sound": sound, "pose": pose})


def learn(corpus: Corpus, settings: Mapping[str, Any], *, seed: int = 0, rounds: int = 20, pull: float = 0.02) -> LearnedMetrics:
    """Learn on sentences that the database does not have; `pull` weighs the way from the start against the relative error.

    `settings` are those of `Efase`, with a temperature above 0. A sharpening above 0 is learned as well, and where
    an expected_share is above 0 the shares of each component.
    """
    if not settings.get("temperature", 0) > 0:
        raise FacesynthError("learning goes through the soft search; give a temperature above 0 (0.3 is a start)")
    database, *held_out = three_parts(corpus, seed)
    model = Efase.from_config({**settings, "learn": False}).fit(database, seed=seed)
    ids, count = [number for part in held_out for number in part.ids], len(held_out[0])
    made = list(in_pieces(partial(_lattices, model, corpus), ids, "lattices"))
    examples, others = ([x for some in part for x in some] for part in (made[:count], made[count:]))
    logs = logs_of(model)
    errors = descend(logs, mean_error, examples, others, seed=seed, rounds=rounds, pull=pull)
    learned = _learned(model, logs, errors)
    model = model.with_weights(**learned.settings, sharpening=0.0, residual=0.0)
    model.count_by(learned.sound_metric, learned.pose_metric)
    if settings.get("expected_share", 0) > 0:
        count = sum(len(part) for part in held_out)
        learned = replace(learned, shares=learned_shares(model, track(chain(*held_out), "shares of components", count)))
        model.set_shares(learned.shares)
    if settings.get("sharpening", 0) > 0:
        learned.settings["sharpening"] = _sharpening(model, held_out[1], settings.get("residual", 0.0))
    return learned


def lattices_of(model: Efase, utterance: Utterance) -> list[Lattice]:
    """The stretches of one recorded utterance, candidates chosen by the model's own weights."""
    speech, fps = utterance.speech, model.config["database_fps"]
    frames = resample(utterance.motion, fps).frames
    query, heard = model.asked(speech)
    nodes, weights = model.nodes(), model.weights()
    bounds = speech.phones.frame_bounds(fps)
    truth = with_gaps(model.pca.encode(torch.from_numpy(frames)).double(), int(bounds[-1]))
    made = []
    for places in stretches(query.phones):
        asked = query.part(places)
        targets = all_targets(nodes, asked, weights)
        cheapest = targets.argmin(axis=1)
        chosen = candidates(nodes, asked, targets, weights, cheapest, model.config["candidates"])
        ranges = [slice(int(bounds[p]), int(bounds[p + 1])) for p in places]
        sounds = [None if heard is None or heard.sounds is None else heard.sounds[p] for p in places]
        poses = [None if heard is None or heard.poses is None else heard.poses[r] for r in ranges]
        rows = zip(chosen, sounds, poses, np.diff(bounds)[places].tolist(), strict=True)
        recorded = truth[bounds[places[0]] : bounds[places[-1] + 1]]
        made.append(
            Lattice(
                [_place(model, asked, t, *row) for t, row in enumerate(rows)],
                [tensors(step_terms(nodes, i, j)) for i, j in pairwise(chosen)],
                recorded,
            )
        )
    return made


def _lattices(model: Efase, corpus: Corpus, number: str) -> list[Lattice]:
    return lattices_of(model, corpus[number])


def mean_error(lattices: Sequence[Lattice], logs: Logs) -> Tensor:
    """Mean over frames of ‖posterior mean - truth‖², differentiable."""
    total, count, values = torch.zeros((), dtype=torch.float64), 0, logs.values()
    weights = {name: values[name] for name in ("pnt", "alpha", "beta", "eta")}
    for lattice in lattices:
        targets = [_target(place, values, logs.factor("sound"), logs.factor("pose")) for place in lattice.places]
        steps = GivenSteps([step.cost(**weights).mT for step in lattice.steps])
        found = posterior([target[None] for target in targets], steps, values["temperature"])
        means = [torch.tensordot(shares[0], p.motion, 1) for p, shares in zip(lattice.places, found.nodes, strict=True)]
        error, frames = squared_error(torch.cat(means), lattice.truth)
        total, count = total + error, count + frames
    return total / max(count, 1)


def _target(place: Place, values: dict[str, Tensor], sound: Tensor, pose: Tensor) -> Tensor:
    phone = values["delta"] * (place.other + values["gamma"] * place.sibling)
    said = values["pnt"] * (phone + values["phi"] * place.feeling)
    return said + values["audio_weight"] * (place.sound @ sound) + values["pose_weight"] * (place.pose @ pose)


def _place(model: Efase, query: Query, t: int, chosen: Ints, sound: Floats | None, poses: Floats | None, count: int) -> Place:
    nodes = model.nodes()
    other = nodes.phones[chosen] != query.phones[t]
    alike = nodes.visemes[chosen] == query.visemes[t]
    feeling = nodes.emotions[chosen] != query.emotions[t]
    heard = np.zeros((len(chosen), 0))
    if sound is not None and model.audio.sound is not None:
        heard = (model.audio.sound.nodes.numpy()[chosen] - sound) ** 2
    fit = np.zeros((len(chosen), 0))
    if poses is not None:
        fit = pose_differences(nodes, chosen, poses) if count else np.zeros((len(chosen), poses.shape[1]))
    motion = stretched(nodes, chosen, count) if count else np.zeros((len(chosen), 0, nodes.frames.shape[1]))
    arrays = (other & ~alike, other & alike, feeling, heard, fit, motion)
    return Place(*(torch.from_numpy(np.asarray(array, np.float64)) for array in arrays))


def tensors(terms: StepTerms) -> StepTerms:
    """The same terms, in which gradients can be taken."""
    return StepTerms(*(torch.from_numpy(np.ascontiguousarray(getattr(terms, f.name))) for f in fields(terms)))


def pose_differences(nodes: Nodes, which: Ints, poses: Floats) -> Floats:
    """[n, D] for each coordinate the mean over the frames of poses [L, D] of (pose - node)², of the nodes `which`."""
    return np.asarray(((stretched(nodes, which, len(poses)) - poses) ** 2).mean(axis=1))


def _learned(model: Efase, logs: Logs, errors: tuple[float, ...]) -> LearnedMetrics:
    """Numbers in the settings' own units: PNT, temperature and audio weight over the median transition under the new weights."""
    numbers = logs.found()
    cost = {name: numbers[name] for name in ("alpha", "beta", "eta", "gamma", "delta", "phi")}
    median = median_transition(model.nodes(), replace(model.weights(), pnt=1.0, **cost))
    scaled = {"penalty": "pnt", "audio_weight": "audio_weight", "temperature": "temperature"}
    settings = cost | {key: numbers[name] / median for key, name in scaled.items()} | {"pose_weight": numbers["pose_weight"]}
    return LearnedMetrics(settings, errors, tuple(logs.factor("sound").tolist()), tuple(logs.factor("pose").tolist()))


def _sharpening(model: Efase, held_out: Corpus, residual: float) -> float:
    """What the model needs, as it has been learned, to move as quickly as the recordings of sentences it does not know."""
    pairs = list(in_pieces(partial(_made_and_recorded, model, held_out), held_out.ids, "sharpening"))
    points = lip_points(held_out.layout) if residual > 0 else None  # the rest of the face gets its movement otherwise
    return matching_share(pairs, points)


def _made_and_recorded(model: Efase, corpus: Corpus, number: str) -> tuple[Motion, Motion]:
    """What the model makes of a recorded speech, and the recording, both at the database's rate."""
    utterance, fps = corpus[number], model.config["database_fps"]
    return model.synthesize(utterance.speech, fps=fps), resample(utterance.motion, fps)
