"""What is heard has its say in the target cost: how a node sounded, and how near it is to the pose that is expected.

Two terms, both 0 in the paper:

* audio: squared distance between the sound of the input's phone and of the node's, log-mel bands at five times over
  the phone and a little around it, as principal components of unit variance;
* pose: mean over the phone's frames of ‖expected - node‖², the expected pose from `PosePredictor`, the node
  time-warped to the phone.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from numba import njit
from numpy.typing import NDArray
from torch import Tensor, nn

from facesynth.corpus import Corpus, node_name
from facesynth.inference.errors import FacesynthError
from facesynth.inference.speech import Speech
from facesynth.inference.warp import stretched
from facesynth.methods.efase.nodes import Floats, Ints, MotionNodes
from facesynth.methods.learn.expectation import PosePredictor
from facesynth.methods.learn.hearing import Hearing
from facesynth.motion.pca import Pca

SPAN = (-0.25, 1.25)
"""From where to where the sound of a phone is taken, in parts of its duration."""
PLACES = 5
COMPONENTS = 16


class Expected(NamedTuple):
    """What the audio terms need of one input."""

    sounds: Floats | None
    """[P, A] sound of each phone."""
    poses: Floats | None
    """[T, D] expected pose of each frame."""


class PhoneSound(nn.Module):
    """How phones sound, as vectors whose squared distance is 2 on average between two nodes."""

    nodes: Tensor
    """[N, A] of every node of the database."""
    size: Tensor
    """[A] what each component is divided by."""

    def __init__(self) -> None:
        super().__init__()
        self.hearing = Hearing()
        self.pca = Pca(torch.zeros(0), torch.zeros(0, 0), torch.zeros(0))
        self.register_buffer("nodes", torch.zeros(0, 0))
        self.register_buffer("size", torch.ones(0))

    def learn(self, corpus: Corpus, names: tuple[str, ...], phones: Ints) -> None:
        """Sounds of the nodes `names`; a drawn node, which has none, gets the mean of its phone's."""
        self.hearing.learn(corpus)
        bands: dict[str, Tensor] = {}
        for utterance in corpus:
            spans = self._bands(utterance.speech)
            bands |= {node_name(utterance.id, number): span for number, span in enumerate(spans)}
        recorded = np.array([name in bands for name in names])
        known = torch.stack([bands[name] for name in names if name in bands])
        self.pca = Pca.fit(known.numpy(), COMPONENTS)
        vectors = np.zeros((len(names), self.pca.basis.shape[1]), np.float32)
        vectors[recorded] = self.pca.encode(known).numpy()
        for place in np.flatnonzero(~recorded):
            alike = recorded & (phones == phones[place])
            vectors[place] = vectors[alike].mean(axis=0) if alike.any() else 0.0
        self.size = torch.from_numpy(vectors[recorded].std(axis=0).clip(1e-6) * np.sqrt(vectors.shape[1])).float()
        self.nodes = torch.from_numpy(vectors) / self.size

    def rescale(self, factors: Tensor) -> None:
        """Let the squared difference of each component [A] count by a factor."""
        self.size, self.nodes = self.size / factors.sqrt(), self.nodes * factors.sqrt()

    def of(self, speech: Speech) -> Floats:
        """[P, A] the sound of each phone of a speech."""
        return np.asarray((self.pca.encode(self._bands(speech)) / self.size).cpu().numpy(), np.float64)

    def _bands(self, speech: Speech) -> Tensor:
        phones = speech.phones
        starts = np.concatenate([[0.0], phones.ends_s[:-1]])
        times_s = starts[:, None] + np.linspace(*SPAN, PLACES) * (phones.ends_s - starts)[:, None]
        return self.hearing.at(speech, times_s).flatten(1)


class AudioTerms(nn.Module):
    """Both terms; each is learned where it has a weight."""

    def __init__(self, *, audio: bool, pose: bool) -> None:
        super().__init__()
        self.sound = PhoneSound() if audio else None
        self.predictor = PosePredictor() if pose else None

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
            self.predictor.metric = torch.tensor(pose, dtype=torch.float32)

    @property
    def empty(self) -> bool:
        """Whether neither term is there."""
        return self.sound is None and self.predictor is None

    def share(self, other: AudioTerms) -> None:
        """Take the terms that are wanted here from another, learned one."""
        for name in ("sound", "predictor"):
            if getattr(self, name) is not None:
                if getattr(other, name) is None:
                    raise FacesynthError(f"this model learned no {name}; train it with audio_weight or pose_weight above 0")
                setattr(self, name, getattr(other, name))

    def costs(
        self, nodes: MotionNodes, expected: Expected, bounds: Ints, spoken: NDArray[np.bool_], weights: tuple[float, float]
    ) -> Floats:
        """[P, N] cost of every node at every phone: bounds [P + 1] first frames, spoken [P], weights of sound and pose."""
        audio_weight, pose_weight = weights
        total = np.zeros((len(bounds) - 1, len(nodes)))
        if self.sound is not None and expected.sounds is not None:
            total[spoken] = audio_weight * sound_distances(
                expected.sounds[spoken], self.sound.nodes.cpu().numpy().astype(np.float64)
            )
        if self.predictor is not None and expected.poses is not None:
            metric = self.predictor.metric.cpu().numpy().astype(np.float64)
            for t in np.flatnonzero(spoken & (np.diff(bounds) > 0)):
                poses = np.ascontiguousarray(expected.poses[bounds[t] : bounds[t + 1]])
                total[t] += pose_weight * pose_costs(nodes.frames, nodes.starts, nodes.lengths, poses, metric)
        return total

    def hear(self, speech: Speech, emotions: Ints, emotion_count: int, fps: float, count: int) -> Expected:
        """emotions [P] index of each phone's emotion, count of frames at `fps`."""
        sounds = self.sound.of(speech) if self.sound is not None else None
        poses = self.predictor.at(speech, emotions, emotion_count, fps, count) if self.predictor is not None else None
        return Expected(sounds, poses)


def sound_distances(sounds: Floats, nodes: Floats) -> Floats:
    """[P, N] squared distance of the sounds [P, A] to those of the nodes [N, A]."""
    squared = (sounds**2).sum(axis=1)[:, None] + (nodes**2).sum(axis=1) - 2 * sounds @ nodes.T
    return np.asarray(np.maximum(squared, 0.0))


def pose_distances(nodes: MotionNodes, which: Ints, poses: Floats) -> Floats:
    """[n, D] for each coordinate the mean over the frames of poses [L, D] of (pose - node)², of the nodes `which`."""
    return np.asarray(((stretched(nodes, which, len(poses)) - poses) ** 2).mean(axis=1))


@njit(cache=True)
def pose_costs(frames, starts, lengths, poses, metric):  # type: ignore[no-untyped-def]
    """[N] `pose_distances` of all nodes times metric [D], without the stretched motions ever being in memory."""
    count, width = poses.shape
    costs = np.zeros(len(starts))
    for n in range(len(starts)):
        last = lengths[n] - 1
        for k in range(count):
            place = 0.5 * last if count == 1 else last * k / (count - 1)
            low = min(int(place), max(last - 1, 0))
            part = place - low
            a, b = starts[n] + low, starts[n] + min(low + 1, last)
            for d in range(width):
                difference = frames[a, d] * (1 - part) + frames[b, d] * part - poses[k, d]
                costs[n] += metric[d] * difference * difference
        costs[n] /= count
    return costs
