"""One model under many settings of its cost, on the same sentences: what does not depend on the settings is computed once.

TC is linear in the weights, and so are both terms of what is heard: the bending, the jumps and the distances between
all nodes are kept as tables, and a search is a sum of tables and a plain Viterbi recursion over all nodes, which reads the
whole table at each phone and therefore keeps it in single precision. Tables take the square of the number of nodes; a
database that is too large for them is searched as any other.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from facesynth.corpus import Corpus, Utterance
from facesynth.inference.arrays import Floats, Ints
from facesynth.inference.efase.costs import Weights
from facesynth.inference.efase.hearing import Heard, Hearing
from facesynth.inference.efase.model import Efase as Speaker
from facesynth.inference.efase.nodes import Nodes
from facesynth.inference.efase.steps import StepTerms, step_terms
from facesynth.inference.speech import Speech
from facesynth.methods.efase.method import Efase
from facesynth.methods.efase.penalty import alike_pairs
from facesynth.motion.resample import resample

MOST_NODES = 2500
"""Of which tables are kept: 150 MB."""


@dataclass(frozen=True, eq=False)
class Example:
    """A sentence to imitate, in the model's coordinates."""

    utterance: Utterance
    truth: Floats
    """[T, D] at the database's rate; NaN where the recording has a gap."""


def examples_of(model: Efase, corpus: Corpus) -> list[Example]:
    """The utterances of a corpus, ready to be compared with."""
    fps = model.config["database_fps"]
    motions = [(utterance, resample(utterance.motion, fps)) for utterance in corpus]
    return [Example(u, model.pca.encode(torch.from_numpy(m.frames)).numpy().astype(np.float64)) for u, m in motions]


def sentence_errors(speaker: Speaker, examples: Sequence[Example]) -> list[float]:
    """Eq. 13 of Deng 2008 for each sentence, in PCA space, where squared distances are those over markers."""
    points, errors = len(speaker.layout.names), []
    for example in examples:
        speech = example.utterance.speech
        feelings, _ = speech.emotions.per_phone(speech.phones)
        bounds = speech.phones.frame_bounds(speaker.database_fps)
        made = speaker.coordinates(speaker.plan(speech), speech.phones.labels, feelings, bounds)
        count = min(len(made), len(example.truth))
        errors.append(float(np.nanmean(((made[:count] - example.truth[:count]) ** 2).sum(axis=1)) / points))
    return errors


class ChangingSettings:
    """A model whose weights, temperature, penalty and share of the expected pose change from one search to the next."""

    def __init__(self, model: Efase) -> None:
        self.model, self._hearing = model, None
        self._steps = _StepTables(model.nodes()) if len(model.nodes()) <= MOST_NODES else None
        if model.speaker.parts.hearing is not None:
            self._hearing = _KeptDistances.kept(model.speaker.parts.hearing)

    def speaker(self, settings: Mapping[str, float]) -> Speaker:
        """What speaks by these settings, as `Efase.with_weights` would, without its tables of bounds."""
        if self._steps is None:
            return self.model.with_weights(**settings).speaker
        config: dict[str, Any] = {**self.model.config, **settings}
        weights = Weights(1.0, *(config[name] for name in ("alpha", "beta", "eta", "gamma", "delta", "phi")))
        unit = self._steps.median(weights) or 1.0
        weights, parts = replace(weights, pnt=config["penalty"] * unit), self.model.speaker.parts
        hearing = self._hearing
        if hearing is not None:
            hearing = replace(hearing, sound_weight=config["audio_weight"] * unit, pose_weight=config["pose_weight"])
        steps = self._steps.under(weights)
        return Speaker(
            replace(
                parts,
                weights=weights,
                settings=replace(
                    parts.settings, temperature=config["temperature"] * unit, expected_share=config["expected_share"]
                ),
                hearing=hearing,
                engine=steps.cheapest_path,
                step_matrix=steps.between,
            )
        )


@dataclass(frozen=True, eq=False)
class _Steps:
    """TC of all steps under some weights."""

    into: NDArray[np.float32]
    """[N, N] of steps to each node (rows) from each node (columns)."""

    def cheapest_path(self, targets: Floats) -> Ints:
        """[T] the nodes of the least cost under target costs [T, N]: Viterbi's recursion, ties to the lowest node."""
        targets, came_from, total = targets.astype(self.into.dtype), [], np.empty_like(self.into)
        cost = targets[0]
        for target in targets[1:]:
            best = np.add(self.into, cost, out=total).argmin(axis=1)
            came_from.append(best)
            cost = total[np.arange(len(best)), best] + target
        path = [int(cost.argmin())]
        for best in reversed(came_from):
            path.append(int(best[path[-1]]))
        return np.array(path[::-1])

    def between(self, nodes: Nodes, before: Ints, after: Ints, weights: Weights) -> Floats:
        """[n, m] of the steps from the nodes `before` to the nodes `after`, as `step_matrix` computes them."""
        return self.into[np.ix_(after, before)].T.astype(np.float64)


class _StepTables:
    """Everything that TC is made of, of all steps of a database."""

    def __init__(self, nodes: Nodes) -> None:
        everything = np.arange(len(nodes))
        terms = step_terms(nodes, everything, everything)
        turned = {part.name: getattr(terms, part.name) for part in fields(StepTerms) if part.name != "orphans"}
        turned = {name: np.ascontiguousarray(table.T) for name, table in turned.items()}
        self._terms = StepTerms(**turned, orphans=np.asarray(terms.orphans)[:, None])
        self._before, self._after = alike_pairs(nodes)

    def under(self, weights: Weights) -> _Steps:
        return _Steps(np.asarray(self._terms.cost(weights.pnt, weights.alpha, weights.beta, weights.eta), np.float32))

    def median(self, weights: Weights) -> float:
        """See `median_transition`."""
        if not len(self._before):
            return 0.0
        bend, place, speed = (getattr(self._terms, name)[self._after, self._before] for name in ("bend", "place", "speed"))
        return float(np.median(weights.beta * bend + weights.eta * place + speed))


@dataclass(frozen=True, eq=False)
class _KeptDistances(Hearing):
    """A `Hearing` that hears each speech once; only how much it counts changes."""

    _kept: dict[int, tuple[Speech, Heard, Floats, Floats]]

    @classmethod
    def kept(cls, hearing: Hearing) -> "_KeptDistances":
        return cls(**{part.name: getattr(hearing, part.name) for part in fields(Hearing)}, _kept={})

    def hear(self, speech: Speech, felt: Ints, count: int, fps: float) -> Heard:
        """See `Hearing.hear`; the same speech comes with the same emotions, as examples do."""
        if id(speech) not in self._kept:
            plain = {part.name: getattr(self, part.name) for part in fields(Hearing)}
            sound, pose = (
                Hearing(**{**plain, "sound_weight": sound, "pose_weight": pose}).hear(speech, felt, count, fps)
                for sound, pose in ((1.0, 0.0), (0.0, 1.0))
            )
            self._kept[id(speech)] = speech, sound, sound.costs, pose.costs
        _, heard, sound_costs, pose_costs = self._kept[id(speech)]
        return replace(heard, costs=self.sound_weight * sound_costs + self.pose_weight * pose_costs)
