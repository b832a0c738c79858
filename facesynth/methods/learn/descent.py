"""Learning a few positive numbers by gradient, on recordings that are not in the database.

Numbers are learned by their logarithms, which are drawn back to where they started: few recordings move them little.
Sentences are parted in three: the database, those to learn from, and those that say when to stop.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import torch
from torch import Tensor

from facesynth.corpus import Corpus
from facesynth.inference.errors import FacesynthError
from facesynth.progress import track

DATABASE_SHARE, LEARN_SHARE = 0.7, 0.2
"""Of the sentences; the rest decides when to stop."""
MOST = 40
"""Utterances that are learned from, and that are stopped by; sentences beyond them stay in the database."""
FEWEST = 10
"""Sentences that can be parted so; of a corpus with fewer, utterances are."""
LEARNING_RATE, BATCH = 0.05, 8
PATIENCE = 4
"""Rounds without a better validation error before learning stops."""

Example = TypeVar("Example")


@dataclass(frozen=True)
class Learned:
    """What learning found."""

    settings: dict[str, float]
    """Settings of the method."""
    errors: tuple[float, ...]
    """Validation error before learning and after each round, squared unit of the layout."""

    @property
    def improvement(self) -> float:
        """Share of the validation error that learning took away."""
        return 1 - min(self.errors) / self.errors[0]

    @property
    def account(self) -> dict[str, Any]:
        """What a trained model remembers of it."""
        return {"rounds": len(self.errors) - 1, "improvement": self.improvement, "settings": self.settings}


class Logs:
    """Positive numbers, and factors that start at 1, by their logarithms; a number that is 0 stays 0."""

    def __init__(self, numbers: Mapping[str, float], factors: Mapping[str, int]) -> None:
        """numbers: where they start; factors: how many there are of each name."""
        self.names = tuple(numbers)
        given = torch.tensor(list(numbers.values()), dtype=torch.float64)
        self.used = given > 0
        self.start = given.clamp(min=1e-30).log()
        self.numbers = self.start.clone().requires_grad_()
        self.factors = {name: torch.zeros(count, dtype=torch.float64).requires_grad_() for name, count in factors.items()}

    @property
    def leaves(self) -> list[Tensor]:
        """What gradients are taken in."""
        return [self.numbers, *self.factors.values()]

    def values(self) -> dict[str, Tensor]:
        """The numbers themselves, differentiable."""
        return dict(zip(self.names, self.numbers.exp() * self.used, strict=True))

    def factor(self, name: str) -> Tensor:
        """[n] the factors of a name, differentiable."""
        return self.factors[name].exp()

    def distance(self) -> Tensor:
        """How far everything is from where it started, mean squared logarithm of the ratios."""
        return torch.cat([(self.numbers - self.start) * self.used, *self.factors.values()]).square().mean()

    def found(self) -> dict[str, float]:
        """The numbers as they are now."""
        return {name: float(value.detach()) for name, value in self.values().items()}


ErrorOf = Callable[[Sequence[Example], Logs], Tensor]
"""Mean error of examples, differentiable in the numbers."""


def descend(
    logs: Logs,
    error_of: ErrorOf[Example],
    examples: Sequence[Example],
    others: Sequence[Example],
    *,
    seed: int,
    rounds: int,
    pull: float,
) -> tuple[float, ...]:
    """Adam over small groups of examples; `logs` end where the error of `others` was least; all of these errors.

    `pull` weighs the way from the start against the error, which counts relative to what it was.
    """
    optimiser = torch.optim.Adam(logs.leaves, LEARNING_RATE)
    rng = np.random.default_rng(seed)
    with torch.no_grad():
        errors, scale = [float(error_of(others, logs))], float(error_of(examples, logs))
    best = [leaf.detach().clone() for leaf in logs.leaves]
    for _ in track(range(rounds), "learning weights", rounds):
        for group in np.array_split(rng.permutation(len(examples)), max(1, len(examples) // BATCH)):
            loss = error_of([examples[i] for i in group], logs) / scale + pull * logs.distance()
            optimiser.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]  # torch leaves it untyped
            optimiser.step()
        with torch.no_grad():
            errors.append(float(error_of(others, logs)))
        if errors[-1] <= min(errors):
            best = [leaf.detach().clone() for leaf in logs.leaves]
        if len(errors) - 1 - int(np.argmin(errors)) >= PATIENCE:
            break
    with torch.no_grad():
        for leaf, value in zip(logs.leaves, best, strict=True):
            leaf.copy_(value)
    return tuple(errors)


def three_parts(corpus: Corpus, seed: int) -> tuple[Corpus, Corpus, Corpus]:
    """(database, to learn from, to stop by): no sentence in two of them, or no utterance where sentences are few."""
    records = corpus.usable_records
    few = len({record.sentence_key for record in records}) < FEWEST
    keys = {record.id: record.id if few else record.sentence_key for record in records}
    sentences = sorted(set(keys.values()))
    if len(sentences) < FEWEST:
        raise FacesynthError(
            f"learning weights parts the recordings in three and needs at least {FEWEST}; got {len(sentences)}: "
            "record more, or set learn=false"
        )
    shuffled = np.random.default_rng(seed).permutation(np.array(sentences, object))
    cuts = [round(DATABASE_SHARE * len(sentences)), round((DATABASE_SHARE + LEARN_SHARE) * len(sentences))]
    parts = [[record.id for key in part for record in records if keys[record.id] == key] for part in np.split(shuffled, cuts)]
    database, examples, others = parts[0], parts[1][:MOST], parts[2][:MOST]
    held_out = {keys[number] for number in examples + others}
    database += [number for part in parts[1:] for number in part if keys[number] not in held_out]
    return corpus.subset(database), corpus.subset(examples), corpus.subset(others)


def squared_error(made: Tensor, recorded: Tensor) -> tuple[Tensor, int]:
    """‖made - recorded‖², both [T, D], summed over the frames without gaps, and how many these are."""
    present = torch.isfinite(recorded).all(dim=1)
    return (made[present] - recorded[present]).square().sum(), int(present.sum())


def with_gaps(recorded: Tensor, count: int) -> Tensor:
    """[count, D] the first frames of recorded [T, D], NaN after its end."""
    missing = recorded.new_full((max(0, count - len(recorded)), recorded.shape[1]), torch.nan)
    return torch.cat([recorded[:count], missing])
