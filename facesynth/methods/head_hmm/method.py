"""Hidden Markov models of the head as a method of the zoo."""

import itertools
from typing import Any, Self

import numpy as np
import torch
from torch import Tensor

from facesynth.corpus import Corpus
from facesynth.inference.arrays import Floats, Ints
from facesynth.inference.errors import FacesynthError
from facesynth.inference.head.hmm import HEARD_FPS, HeadHmm, Network
from facesynth.inference.head.voice import prosody_of
from facesynth.inference.motion import Motion
from facesynth.inference.speech import Speech
from facesynth.methods.head_hmm.baum_welch import NEVER, Hmm, begun, learn
from facesynth.methods.head_hmm.capabilities import CAPABILITIES
from facesynth.methods.head_hmm.codebook import codebook
from facesynth.methods.learn.heads import about_mean, angles_at, sound_windows, still_face, with_head
from facesynth.methods.method import Method
from facesynth.methods.parts import part
from facesynth.methods.registry import register

UNSEEN = 0.1
"""So often every step from cluster to cluster counts as seen before any is counted."""


@register(CAPABILITIES)
class HeadHmmMethod(Method):
    """Clusters of head rotations, in which the head is as long as the prosody fits (Deng 2006, §4.4).

    Parameters
    ----------
    clusters : int
        K of the codebook.
    states : int
        S of each model.
    mixtures : int
        M Gaussians a state.
    ergodic : bool
        All states follow each other; otherwise from left to right.
    rounds : int
        Most rounds of forward-backward.
    bigram : float
        Exponent of the probability of a step between clusters.
    centred : bool
        Whether each recording counts from its own mean posture, which no sound tells; the dissertation's do not.
    noise : float
        Half width of the uniform noise on key points, in standard deviations of a cluster.
    """

    frame: Tensor
    """[C] the face at rest."""
    prosody_scale: Tensor
    """[6] standard deviations."""
    log_start: Tensor
    log_step: Tensor
    clusters: Tensor
    """See `Network`."""
    means: Tensor
    spreads: Tensor
    """See `HeadHmm`."""
    log_weights: Tensor
    """[N, M] of the mixtures of all states."""
    mixture_means: Tensor
    """[N, M, 6]"""
    mixture_variances: Tensor
    """[N, M, 6]"""

    def __init__(
        self,
        clusters: int = 16,
        states: int = 3,
        mixtures: int = 2,
        ergodic: bool = False,
        rounds: int = 20,
        bigram: float = 1.0,
        centred: bool = True,
        noise: float = 0.5,
    ) -> None:
        super().__init__()
        if clusters < 2 or min(states, mixtures, rounds) < 1 or min(bigram, noise) < 0:
            given = ", ".join(f"{name}={value}" for name, value in self.config.items())
            raise FacesynthError(f"head_hmm wants 2 clusters or more, counts of 1 or more and no negative factor; got {given}")
        names = ("frame", "prosody_scale", "log_start", "log_step", "clusters", "means", "spreads")
        for name in (*names, "log_weights", "mixture_means", "mixture_variances"):
            self.register_buffer(name, torch.zeros(0))

    def fit(self, corpus: Corpus, *, seed: int = 0) -> Self:
        """Learn from the recordings in which the head's pose is known; nothing is drawn from chance."""
        self.learned_from(corpus)
        recordings = with_head(corpus)
        angles = [angles_at(u, HEARD_FPS) for u in recordings]
        angles = about_mean(angles) if self.config["centred"] else angles
        prosody = [prosody_of([sound_windows(u, HEARD_FPS, len(a))], HEARD_FPS) for u, a in zip(recordings, angles, strict=True)]
        scale = np.maximum(np.concatenate(prosody).std(axis=0), 1e-6)
        cells = codebook(np.concatenate(angles), self.config["clusters"])
        least = 1 if self.config["ergodic"] else self.config["states"]
        tracks = [without_short(track, least) for track in _split(cells.labels, [len(a) for a in angles])]
        used, numbers = np.unique(np.concatenate(tracks), return_inverse=True)
        if len(used) < 2:
            raise FacesynthError(
                f"the heads in {corpus.path} hardly move: {len(used)} cluster is left; record more, or fewer states"
            )
        tracks = _split(numbers, [len(a) for a in angles])
        models, facts = self._learn_models(tracks, [p / scale for p in prosody], len(used))
        network = composed(models, *_counts(tracks, len(used)), self.config["bigram"])
        self._keep(still_face(corpus), scale, models, network, _cells(np.concatenate(angles), numbers, len(used)))
        self.facts = {"recordings": len(recordings), "clusters": len(used), "distortion": cells.distortions[-1], **facts}
        return self.eval()

    def synthesize(self, speech: Speech, *, seed: int = 0, **options: Any) -> Motion:
        """Head motion from the sound; the seed moves key points a little."""
        self.refuse(options)
        return self.speaker().synthesize(speech, seed=seed)

    def speaker(self) -> HeadHmm:
        """What runs without torch."""
        network = Network(_array(self.log_start), _array(self.log_step), self.clusters.cpu().numpy().astype(np.int64))
        spreads = self.config["noise"] * _array(self.spreads)
        heard = part(self.log_likelihood, self.means.device)
        frame = self.frame.cpu().numpy()
        return HeadHmm(self.fitted_layout, frame, self.fps, self.emotions, network, _array(self.means), spreads, heard)

    def log_likelihood(self, prosody: Tensor) -> list[Tensor]:
        """[..., T, N] of prosody [..., T, 6] in each state."""
        away = (prosody / self.prosody_scale)[..., None, None, :] - self.mixture_means
        norm = torch.log(2 * torch.pi * self.mixture_variances)
        return [(self.log_weights - 0.5 * (norm + away**2 / self.mixture_variances).sum(-1)).logsumexp(-1)]

    def _learn_models(self, tracks: list[Ints], prosody: list[Floats], count: int) -> tuple[list[Hmm], dict[str, Any]]:
        settings, models, likelihoods = self.config, [], []
        for cluster in range(count):
            heard = [p[a:b] for track, p in zip(tracks, prosody, strict=True) for a, b, k in runs_of(track) if k == cluster]
            first = begun(heard, settings["states"], settings["mixtures"], all_follow=settings["ergodic"])
            model, course = learn(first, heard, settings["rounds"])
            models.append(model)
            likelihoods.append(course)
        frames = sum(len(p) for p in prosody)
        before, after = sum(course[0] for course in likelihoods), sum(course[-1] for course in likelihoods)
        return models, {"log_likelihood_before": before / frames, "log_likelihood": after / frames}

    def _keep(self, frame: Any, scale: Floats, models: list[Hmm], network: Network, cells: tuple[Floats, Floats]) -> None:
        arrays = {
            "frame": frame,
            "prosody_scale": scale,
            "log_start": network.log_start,
            "log_step": network.log_step,
            "clusters": network.clusters,
            "means": cells[0],
            "spreads": cells[1],
            "log_weights": np.concatenate([m.mixtures.log_weights for m in models]),
            "mixture_means": np.concatenate([m.mixtures.means for m in models]),
            "mixture_variances": np.concatenate([m.mixtures.variances for m in models]),
        }
        device = self.device
        for name, array in arrays.items():
            self.register_buffer(name, torch.from_numpy(np.ascontiguousarray(array, np.float32)).to(device))


def composed(models: list[Hmm], first: Floats, bigram: Floats, weight: float) -> Network:
    """One network of the models, from each of which every other may follow.

    first: [K] probability that an utterance begins in a cluster; bigram: [K, K] of the cluster (column) after a cluster (row).
    """
    states = len(models[0].log_start)
    count = len(models)
    start = np.concatenate([np.log(first[k]) + models[k].log_start for k in range(count)])
    step = np.full((count * states, count * states), NEVER)
    for i, model in enumerate(models):
        rows = slice(i * states, (i + 1) * states)
        arcs = [model.log_exit[:, None] + weight * np.log(bigram[i, j]) + models[j].log_start for j in range(count)]
        step[rows] = np.concatenate(arcs, axis=1)
        step[rows, rows] = np.logaddexp(step[rows, rows], model.log_step)
    return Network(np.maximum(start, NEVER), np.maximum(step, NEVER), np.repeat(np.arange(count), states))


def runs_of(track: Ints) -> list[tuple[int, int, int]]:
    """(first, stop, label) of stretches of one label in [T]."""
    edges = np.flatnonzero(np.diff(track)) + 1
    bounds = [0, *edges.tolist(), len(track)]
    return [(a, b, int(track[a])) for a, b in itertools.pairwise(bounds)]


def without_short(track: Ints, least: int) -> Ints:
    """The same labels [T] with stretches of fewer than `least` frames given to the stretch before, the first to the one after."""
    out = track.copy()
    while len(runs := runs_of(out)) > 1:
        short = next(((a, b, n) for n, (a, b, _) in enumerate(runs) if b - a < least), None)
        if short is None:
            break
        a, b, n = short
        out[a:b] = runs[n - 1][2] if n else runs[1][2]
    return out


def _counts(tracks: list[Ints], count: int) -> tuple[Floats, Floats]:
    """Probabilities [K] of the first cluster and [K, K] of the next one."""
    first, bigram = np.full(count, UNSEEN), np.full((count, count), UNSEEN)
    for track in tracks:
        labels = [k for _, _, k in runs_of(track)]
        first[labels[0]] += 1
        np.add.at(bigram, (labels[:-1], labels[1:]), 1)
    return first / first.sum(), bigram / bigram.sum(axis=1, keepdims=True)


def _cells(angles: Floats, labels: Ints, count: int) -> tuple[Floats, Floats]:
    """Means and standard deviations [K, 3] of the clusters."""
    inside = [angles[labels == k] for k in range(count)]
    return np.stack([a.mean(axis=0) for a in inside]), np.stack([a.std(axis=0) for a in inside])


def _split(labels: Ints, lengths: list[int]) -> list[Ints]:
    return [np.asarray(track, np.int64) for track in np.split(labels, np.cumsum(lengths)[:-1])]


def _array(buffer: Tensor) -> Floats:
    return buffer.cpu().numpy().astype(np.float64)
