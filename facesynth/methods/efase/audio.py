"""What is learned of sound for the target cost: how the nodes sounded, and what pose a sound leads one to expect."""

from collections.abc import Sequence
from copy import copy
from typing import Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from facesynth.corpus import Corpus, node_name
from facesynth.inference.arrays import Ints
from facesynth.inference.efase.hearing import Hearing, PhoneSounds, PoseDistances, phone_spans
from facesynth.inference.efase.nodes import Nodes
from facesynth.inference.errors import FacesynthError
from facesynth.methods.learn.expectation import BANDS, PosePredictor
from facesynth.methods.learn.hearing import Features
from facesynth.methods.learn.hearing import Hearing as Bands
from facesynth.motion.pca import Pca

COMPONENTS = 16
"""Principal components of a phone's sound."""


class PhoneSound(nn.Module):
    """How phones sound, as vectors whose squared distance is 2 on average between two nodes."""

    nodes: Tensor
    """[N, A] of every node of the database."""
    size: Tensor
    """[A] what each component is divided by."""

    def __init__(self, features: Features = "log_mel") -> None:
        super().__init__()
        self.hearing = Bands(features, BANDS)
        self.pca = Pca(torch.zeros(0), torch.zeros(0, 0), torch.zeros(0))
        self.register_buffer("nodes", torch.zeros(0, 0))
        self.register_buffer("size", torch.ones(0))

    def learn(self, corpus: Corpus, names: tuple[str, ...], phones: Ints) -> None:
        """Sounds of the nodes `names`; a drawn node, which has none, gets the mean of its phone's."""
        self.hearing.learn(corpus)
        standard = self.hearing.standard()
        spans: dict[str, np.ndarray] = {}
        for utterance in corpus:
            own = phone_spans(self.hearing.bands(utterance.speech), utterance.speech.phones, standard)
            spans |= {node_name(utterance.id, number): span for number, span in enumerate(own)}
        recorded = np.array([name in spans for name in names])
        known = np.stack([spans[name] for name in names if name in spans])
        self.pca = Pca.fit(known, COMPONENTS)
        vectors = np.zeros((len(names), self.pca.basis.shape[1]), np.float32)
        vectors[recorded] = self.pca.encode(torch.from_numpy(known)).numpy()
        vectors = _with_means(vectors, recorded, phones)
        self.size = torch.from_numpy(vectors[recorded].std(axis=0).clip(1e-6) * np.sqrt(vectors.shape[1])).float()
        self.nodes = torch.from_numpy(vectors) / self.size

    def of_nodes(self, kept: Ints, phones: Ints) -> Self:
        """The same for the nodes `kept` [K] and others after them, which have no sound; phones [N] of all of them."""
        other = copy(self)
        other._buffers = dict(self._buffers)
        vectors = np.zeros((len(phones), self.nodes.shape[1]), np.float32)
        vectors[: len(kept)] = self.nodes.cpu().numpy()[kept]
        other.nodes = torch.from_numpy(_with_means(vectors, np.arange(len(phones)) < len(kept), phones)).to(self.nodes)
        return other

    def rescale(self, factors: Tensor) -> None:
        """Let the squared difference of each component [A] count by a factor."""
        root = factors.sqrt().to(self.size)
        self.size, self.nodes = self.size / root, self.nodes * root

    def sounds(self) -> PhoneSounds:
        """What the search takes of it."""
        nodes, centre, basis, size = (part.cpu().numpy() for part in (self.nodes, self.pca.mean, self.pca.basis, self.size))
        return PhoneSounds(nodes, centre, basis, size, self.hearing.standard())


def _with_means(vectors: NDArray[np.float32], recorded: NDArray[np.bool_], phones: Ints) -> NDArray[np.float32]:
    """Sounds [N, A] in which a node that was not recorded has the mean of its phone's."""
    for place in np.flatnonzero(~recorded):
        alike = recorded & (phones == phones[place])
        vectors[place] = vectors[alike].mean(axis=0) if alike.any() else 0.0
    return vectors


class AudioTerms(nn.Module):
    """Both terms; each is learned where it has a weight. Both hear the same features; voices: see `PosePredictor`."""

    def __init__(self, *, audio: bool, pose: bool, features: Features = "log_mel", voices: int = 0) -> None:
        super().__init__()
        self.sound = PhoneSound(features) if audio else None
        self.predictor = PosePredictor(features, voices=voices) if pose else None

    def learn(self, corpus: Corpus, pca: Pca, names: tuple[str, ...], phones: Ints, seed: int) -> None:
        """From the corpus that the nodes were cut from."""
        if self.sound is not None:
            self.sound.learn(corpus, names, phones)
        if self.predictor is not None:
            self.predictor.learn(corpus, pca.encode, seed)

    def count_by(self, sound: Sequence[float], pose: Sequence[float]) -> None:
        """Let the squared differences of each component of the sound and of the pose count by these factors."""
        if self.sound is not None:
            self.sound.rescale(torch.tensor(sound, dtype=torch.float32))
        if self.predictor is not None:
            self.predictor.metric = torch.tensor(pose, dtype=torch.float32, device=self.predictor.metric.device)

    @property
    def empty(self) -> bool:
        """Whether neither term is there."""
        return self.sound is None and self.predictor is None

    def share(self, other: "AudioTerms") -> None:
        """Take the terms that are wanted here from another, learned one."""
        for name in ("sound", "predictor"):
            if getattr(self, name) is not None:
                if getattr(other, name) is None:
                    raise FacesynthError(f"this model learned no {name}; train it with audio_weight or pose_weight above 0")
                setattr(self, name, getattr(other, name))

    def of_nodes(self, kept: Ints, phones: Ints) -> Self:
        """The terms for another choice of nodes; see `PhoneSound.of_nodes`."""
        other = type(self)(audio=False, pose=False)
        other.sound = None if self.sound is None else self.sound.of_nodes(kept, phones)
        other.predictor = self.predictor
        return other

    def heard_by(self, nodes: Nodes, weights: tuple[float, float]) -> Hearing | None:
        """What the search hears with, if it hears at all; weights of sound and pose."""
        learned = self.sound or self.predictor
        if learned is None:
            return None
        sounds = self.sound.sounds() if self.sound is not None else None
        expectation = distances = None
        if self.predictor is not None:
            expectation = self.predictor.expectation()
            distances = PoseDistances(nodes, self.predictor.metric.cpu().numpy())
        return Hearing(learned.hearing.bands, sounds, weights[0], expectation, distances, weights[1])
