"""Weights of the cost, and a linear metric of sound and of expected pose, learned by gradient through the soft search.

The posterior mean is differentiable in every cost (see `soft`), so its squared distance to recordings that are not in
the database is too. What is learned: PNT, a1 … a6, the two audio weights, the temperature, and one factor for each
component of the sound and of the expected pose; all by their logarithms, drawn back to where they started. Sentences
are parted in three: the database, those to learn from, and those that say when to stop.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import torch
from torch import Tensor

from facesynth.corpus import Corpus, Utterance
from facesynth.errors import FacesynthError
from facesynth.methods.efase.audio import pose_distances
from facesynth.methods.efase.costs import Query, target_costs
from facesynth.methods.efase.method import Efase
from facesynth.methods.efase.nodes import Floats, Ints
from facesynth.methods.efase.penalty import median_transition
from facesynth.methods.efase.plan import part, stretches
from facesynth.methods.efase.soft import candidates, posterior
from facesynth.methods.efase.steps import CostWeights, StepTerms, step_terms, stretched
from facesynth.motion.resample import resample
from facesynth.progress import track

DATABASE_SHARE, LEARN_SHARE = 0.7, 0.2
"""Of the sentences; the rest decides when to stop."""
NUMBERS = ("pnt", "alpha", "beta", "eta", "gamma", "delta", "phi", "audio_weight", "pose_weight", "temperature")
LEARNING_RATE, BATCH = 0.05, 8
PATIENCE = 4
"""Rounds without a better validation error before learning stops."""


@dataclass(frozen=True)
class Learned:
    """What learning found."""

    settings: dict[str, float]
    """Settings of `Efase`."""
    sound_metric: tuple[float, ...]
    pose_metric: tuple[float, ...]
    errors: tuple[float, ...]
    """Validation error before learning and after each round, squared unit of the layout, summed over the markers."""

    @property
    def improvement(self) -> float:
        """Share of the validation error that learning took away."""
        return 1 - min(self.errors) / self.errors[0]


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
    truth: Tensor
    """[L, D] what was recorded, NaN in gaps."""


@dataclass(frozen=True, eq=False)
class Lattice:
    """One stretch of speech: T phones and the steps between them."""

    places: Sequence[Place]
    steps: Sequence[StepTerms]


class _Parameters:
    """Logarithms of everything that is learned, and where they started."""

    def __init__(self, model: Efase) -> None:
        weights = model.weights()
        audio_weight, pose_weight = model.audio_weights()
        numbers = [getattr(weights, name) for name in NUMBERS[:7]]
        numbers += [audio_weight, pose_weight, model.temperature]
        sound = model.audio.sound.size if model.audio.sound is not None else torch.zeros(0)
        pose = model.audio.predictor.metric if model.audio.predictor is not None else torch.zeros(0)
        self.used = torch.tensor([number > 0 for number in numbers])
        self.start = torch.tensor([max(number, 1e-30) for number in numbers], dtype=torch.float64).log()
        self.numbers = self.start.clone().requires_grad_()
        self.sound = torch.zeros(len(sound), dtype=torch.float64).requires_grad_()
        self.pose = torch.zeros(len(pose), dtype=torch.float64).requires_grad_()

    @property
    def leaves(self) -> list[Tensor]:
        return [self.numbers, self.sound, self.pose]

    def values(self) -> dict[str, Tensor]:
        return {name: value * used for name, value, used in zip(NUMBERS, self.numbers.exp(), self.used, strict=True)}

    def distance(self) -> Tensor:
        """How far everything is from where it started, mean squared logarithm of the ratios."""
        moved = [(self.numbers - self.start) * self.used, self.sound, self.pose]
        return torch.cat(moved).square().mean()

    def copy(self) -> list[Tensor]:
        return [leaf.detach().clone() for leaf in self.leaves]


def learn(corpus: Corpus, settings: dict[str, Any], *, seed: int = 0, rounds: int = 20, pull: float = 0.02) -> Learned:
    """Learn on sentences that the database does not have; `pull` weighs the way from the start against the relative error.

    `settings` are those of `Efase`, with a temperature above 0.
    """
    if not settings.get("temperature", 0) > 0:
        raise FacesynthError("learning goes through the soft search; give a temperature above 0 (0.3 is a start)")
    database, examples, others = _three_parts(corpus, seed)
    model = Efase.from_config(settings).fit(database, seed=seed)
    lattices = [[x for u in track(some, "lattices", len(some)) for x in lattices_of(model, u)] for some in (examples, others)]
    parameters = _Parameters(model)
    return _learned(model, parameters, *_descend(parameters, lattices[0], lattices[1], seed, rounds, pull))


def apply(learned: Learned, model: Efase) -> None:
    """Give a trained model with `learned.settings` the metrics."""
    if model.audio.sound is not None:
        model.audio.sound.rescale(torch.tensor(learned.sound_metric, dtype=torch.float32))
    if model.audio.predictor is not None:
        model.audio.predictor.metric = torch.tensor(learned.pose_metric, dtype=torch.float32)


def lattices_of(model: Efase, utterance: Utterance) -> list[Lattice]:
    """The stretches of one recorded utterance, candidates chosen by the model's own weights."""
    speech, fps = utterance.speech, model.config["database_fps"]
    truth = model.pca.encode(torch.from_numpy(resample(utterance.motion, fps).frames)).double()
    query, expected = model.asked(speech)
    bounds = speech.phones.frame_bounds(fps)
    made = []
    for places in stretches(query.phones):
        asked = part(query, places)
        targets = np.stack([target_costs(model.nodes(), asked, t, model.weights()) for t in range(len(asked))])
        cheapest = targets.argmin(axis=1)
        chosen = candidates(model.nodes(), asked, targets, model.weights(), cheapest, model.config["candidates"])
        ranges = [slice(int(bounds[p]), int(bounds[p + 1])) for p in places]
        sounds = [None if expected.sounds is None else expected.sounds[p] for p in places]
        poses = [None if expected.poses is None else expected.poses[r] for r in ranges]
        rows = zip(chosen, sounds, poses, (truth[r] for r in ranges), strict=True)
        made.append(
            Lattice(
                [_place(model, asked, t, *row) for t, row in enumerate(rows)],
                [step_terms(model.nodes(), i, j) for i, j in pairwise(chosen)],
            )
        )
    return made


def mean_error(lattices: Sequence[Lattice], values: dict[str, Tensor], sound: Tensor, pose: Tensor) -> Tensor:
    """Mean over frames of ‖posterior mean - truth‖², differentiable; sound [A] and pose [D] are logarithms of factors."""
    total, count = torch.zeros((), dtype=torch.float64), 0
    weights = CostWeights(*(values[name] for name in ("pnt", "alpha", "beta", "eta")))
    for lattice in lattices:
        targets = [_target(place, values, sound.exp(), pose.exp()) for place in lattice.places]
        found = posterior(targets, [step.cost(weights) for step in lattice.steps], values["temperature"])
        for place, shares in zip(lattice.places, found.nodes, strict=True):
            error = (torch.tensordot(shares, place.motion, 1) - place.truth).square().sum(dim=1)
            present = torch.isfinite(error)
            total, count = total + error[present].sum(), count + int(present.sum())
    return total / max(count, 1)


def _target(place: Place, values: dict[str, Tensor], sound: Tensor, pose: Tensor) -> Tensor:
    phone = values["delta"] * (place.other + values["gamma"] * place.sibling)
    said = values["pnt"] * (phone + values["phi"] * place.feeling)
    return said + values["audio_weight"] * (place.sound @ sound) + values["pose_weight"] * (place.pose @ pose)


def _place(model: Efase, query: Query, t: int, chosen: Ints, sound: Floats | None, poses: Floats | None, truth: Tensor) -> Place:
    nodes, count = model.nodes(), len(truth)
    other = nodes.phones[chosen] != query.phones[t]
    alike = nodes.visemes[chosen] == query.visemes[t]
    feeling = nodes.emotions[chosen] != query.emotions[t]
    heard = np.zeros((len(chosen), 0))
    if sound is not None and model.audio.sound is not None:
        heard = (model.audio.sound.nodes.numpy()[chosen] - sound) ** 2
    fit = np.zeros((len(chosen), 0))
    if poses is not None:
        fit = pose_distances(nodes, chosen, poses) if count else np.zeros((len(chosen), poses.shape[1]))
    motion = stretched(nodes, chosen, count) if count else np.zeros((len(chosen), 0, nodes.frames.shape[1]))
    arrays = (other & ~alike, other & alike, feeling, heard, fit, motion, truth.numpy())
    return Place(*(torch.from_numpy(np.asarray(array, np.float64)) for array in arrays))


def _three_parts(corpus: Corpus, seed: int) -> tuple[Corpus, Corpus, Corpus]:
    sentences = sorted({record.sentence_key for record in corpus.usable_records})
    if len(sentences) < 10:
        raise FacesynthError(f"learning parts the sentences in three and needs at least 10; this corpus has {len(sentences)}")
    shuffled = np.random.default_rng(seed).permutation(np.array(sentences, object))
    cuts = [round(DATABASE_SHARE * len(sentences)), round((DATABASE_SHARE + LEARN_SHARE) * len(sentences))]
    parts = [set(group) for group in np.split(shuffled, cuts)]
    ids = [[r.id for r in corpus.usable_records if r.sentence_key in group] for group in parts]
    database, examples, others = (corpus.subset(some) for some in ids)
    return database, examples, others


def _descend(
    parameters: _Parameters, examples: list[Lattice], others: list[Lattice], seed: int, rounds: int, pull: float
) -> tuple[list[Tensor], list[float]]:
    """Adam over small groups of stretches; the parameters of the best validation error, and all of these errors."""
    optimiser = torch.optim.Adam(parameters.leaves, LEARNING_RATE)
    rng = np.random.default_rng(seed)
    errors = [_error(parameters, others)]
    best, scale = parameters.copy(), _error(parameters, examples)
    for _ in track(range(rounds), "learning weights", rounds):
        for group in np.array_split(rng.permutation(len(examples)), max(1, len(examples) // BATCH)):
            error = mean_error([examples[i] for i in group], parameters.values(), parameters.sound, parameters.pose)
            loss = error / scale + pull * parameters.distance()
            optimiser.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]  # torch leaves it untyped
            optimiser.step()
        errors.append(_error(parameters, others))
        if errors[-1] <= min(errors):
            best = parameters.copy()
        if len(errors) - 1 - int(np.argmin(errors)) >= PATIENCE:
            break
    return best, errors


@torch.no_grad()
def _error(parameters: _Parameters, lattices: Sequence[Lattice]) -> float:
    return float(mean_error(lattices, parameters.values(), parameters.sound, parameters.pose))


def _learned(model: Efase, parameters: _Parameters, best: list[Tensor], errors: list[float]) -> Learned:
    """Numbers in the settings' own units: PNT, temperature and audio weight over the median transition under the new weights."""
    numbers = {n: float(v.exp() * used) for n, v, used in zip(NUMBERS, best[0], parameters.used, strict=True)}
    cost = {name: numbers[name] for name in ("alpha", "beta", "eta", "gamma", "delta", "phi")}
    median = median_transition(model.nodes(), replace(model.weights(), pnt=1.0, **cost))
    scaled = {"penalty": "pnt", "audio_weight": "audio_weight", "temperature": "temperature"}
    settings = cost | {key: numbers[name] / median for key, name in scaled.items()} | {"pose_weight": numbers["pose_weight"]}
    return Learned(settings, tuple(best[1].exp().tolist()), tuple(best[2].exp().tolist()), tuple(errors))
