"""A search in whose cost the expected pose counts by how sure the network is of it, for `search_variants.py`.

The network says the logarithm of the deviation σ of each of its components at each moment. Differences between a node and the
expected pose are told in those components, and each squared difference counts by w = σ^(-2 power), scaled so that the spread of
all recorded poses costs on average what it costs where every coordinate counts 1.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Self

import numpy as np
import torch

from facesynth.corpus import Corpus
from facesynth.inference.arrays import Floats, Ints
from facesynth.inference.efase.hearing import Heard, Hearing
from facesynth.inference.efase.nodes import Nodes
from facesynth.inference.expectation import Expectation, Said, Single
from facesynth.inference.speech import Speech
from facesynth.inference.warp import stretched
from facesynth.methods.learn.expectation import PosePredictor

LOWEST, HIGHEST = -5.0, 3.0
"""Logarithms of deviations beyond these are not believed."""


@dataclass(frozen=True)
class Certainty:
    """Which of what the network says of its certainty counts."""

    components: bool = True
    moments: bool = True
    power: float = 1.0
    """1: by variances; 0.5: by deviations; 0: everything counts the same."""
    beyond_spread: bool = False
    """Whether a component of which nothing is known, whose σ is the spread of all poses, counts nothing."""


@dataclass(frozen=True, eq=False)
class CertainDistances:
    """In place of `PoseDistances`."""

    nodes: Nodes
    into: Floats
    """[D, R] coordinates to the network's components."""
    spread: Floats
    """[R] variance of the components of all nodes."""
    size: Floats
    """[R] what a squared unit of a component is in squared coordinates."""
    usual: Floats
    """[R] mean variance that the network says."""
    certainty: Certainty
    scale: float = 1.0

    def scaled(self, variances: Floats) -> Self:
        """So scaled for variances [F, R] of some speech."""
        weights = replace(self, scale=1.0).weights(variances)
        return replace(self, scale=float((self.spread * self.size).sum() / (weights @ self.spread).mean()))

    def weights(self, variances: Floats) -> Floats:
        """[F, R] by what a squared difference of each component counts at each moment."""
        said = variances if self.certainty.moments else np.broadcast_to(self.usual, variances.shape)
        if not self.certainty.components:  # all components by the variance of all together
            together = (said @ self.size)[:, None] / self.size.sum()
            return np.asarray(self.scale * together**-self.certainty.power * self.size)
        least = self.spread**-self.certainty.power if self.certainty.beyond_spread else 0.0
        return np.asarray(self.scale * np.maximum(said**-self.certainty.power - least, 0.0))

    def of(self, pieces: Sequence[Floats]) -> Floats:
        """[P, N] for P pieces [L, D + R]: expected poses, and logarithms of the variances of the components."""
        return np.stack([self._of(piece[:, : len(self.into)], np.exp(piece[:, len(self.into) :])) for piece in pieces])

    def _of(self, poses: Floats, variances: Floats) -> Floats:
        nodes = stretched(self.nodes, np.arange(len(self.nodes)), len(poses))
        apart = np.square((nodes - poses) @ self.into)
        return np.asarray(np.einsum("nlr,lr->n", apart, self.weights(variances)) / len(poses))


@dataclass(frozen=True, eq=False)
class CertainHearing(Hearing):
    """Hears poses and variances, and passes poses on."""

    @classmethod
    def of(cls, hearing: Hearing, predictor: PosePredictor, certainty: Certainty, some: Corpus) -> Self:
        """Scaled by the speech of every eighth utterance of `some`."""
        assert hearing.distances is not None
        sure, nodes = sure_expectation(predictor), hearing.distances.nodes
        variances = np.exp(np.concatenate([said_of(sure, predictor, some, name) for name in some.ids[::8]]))
        into = np.linalg.pinv(predictor.into.cpu().numpy().astype(np.float64))
        size = np.square(predictor.into.cpu().numpy()).sum(axis=1)
        spread = (nodes.frames @ into).var(axis=0)
        distances = CertainDistances(nodes, into, spread, size, variances.mean(axis=0), certainty).scaled(variances)
        parts = {field.name: getattr(hearing, field.name) for field in fields(Hearing)}
        return cls(**{**parts, "expectation": sure, "distances": distances})

    def hear(self, speech: Speech, felt: Ints, count: int, fps: float) -> Heard:
        heard = super().hear(speech, felt, count, fps)
        assert heard.poses is not None
        assert isinstance(self.distances, CertainDistances)
        return replace(heard, poses=heard.poses[:, : len(self.distances.into)])


def sure_expectation(predictor: PosePredictor) -> Expectation:
    """What is expected [F, D], and beside it the logarithms of the variances [F, R]."""

    @torch.no_grad()
    def network(told: Single) -> Single:
        asked = torch.from_numpy(told)
        deviations = predictor.network(asked[None])[1][0].clamp(LOWEST, HIGHEST)
        return np.hstack([predictor(asked).numpy(), 2 * deviations.numpy()])

    return replace(predictor.expectation(), network=network)


def said_of(sure: Expectation, predictor: PosePredictor, some: Corpus, name: str) -> Floats:
    """[T, R] logarithms of the variances of one utterance."""
    speech = some[name].speech
    count = int(speech.phones.frame_bounds(some.fps)[-1])
    said = sure.poses(predictor.hearing.bands(speech), Said.of(speech, some.emotions), some.fps, count)
    return said[:, len(predictor.onto) :]
