"""A small temporal convolution network: what a user would train instead."""

from __future__ import annotations

from typing import Any, NamedTuple, Self

import numpy as np
import torch
from scipy.interpolate import CubicSpline
from torch import Tensor, nn

from facesynth.corpus import Corpus, Utterance
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion
from facesynth.inference.speech import Speech
from facesynth.methods.learn.frames import complete, complete_frames, refuse_options
from facesynth.methods.learn.hearing import Hearing
from facesynth.methods.method import Method
from facesynth.methods.registry import register
from facesynth.motion.pca import Pca
from facesynth.progress import track

RATE = 50.0
"""Frames of sound that the network reads per second, Hz: the 20 ms of the ridge's 21 frames."""
WIDTH, KERNEL, DROPOUT = 128, 5, 0.3
DILATIONS = (1, 1, 2, 2)
"""Reach 12 frames to either side: ±240 ms."""
BATCH, WINDOW = 16, 96
"""Windows of a step, and frames of a window."""
LEARNING_RATE, WEIGHT_DECAY = 2e-3, 1e-2


class Tracks(NamedTuple):
    """One utterance at RATE."""

    heard: Tensor
    """[F, 40] sound."""
    moved: Tensor
    """[F, D] motion, in units of its largest standard deviation."""
    present: Tensor
    """[F] 1 where the recording has a complete frame, 0 elsewhere."""


@register("tcn")
class Tcn(Method):
    """Four 1-D convolutions, 128 wide, kernel 5, dilation up to 2, dropout 0.3, from log-mel bands to 25 components.

    AdamW on the squared error over random windows, the learning rate falling along a cosine. The same seed gives the
    same weights on the same machine with the same number of threads.
    """

    scale: Tensor
    """[1] standard deviation of the first component, unit of the layout."""

    def __init__(self, components: int = 25, steps: int = 600) -> None:
        super().__init__()
        self.components, self.steps = components, steps
        self.hearing = Hearing()
        self.pca = Pca(torch.zeros(0), torch.zeros(0, 0), torch.zeros(0))
        self.network = network(self.hearing.mel.bands, components, seed=0)
        self.register_buffer("scale", torch.ones(1))

    def fit(self, corpus: Corpus, *, seed: int = 0) -> Self:
        """Learn from the complete frames of a corpus."""
        self.learned_from(corpus)
        frames = complete_frames(corpus)
        self.pca = Pca.fit(frames, self.components)
        self.hearing.learn(corpus)
        self.scale = self.pca.encode(torch.from_numpy(frames)).std(dim=0).max().clamp(min=1e-6).reshape(1)
        tracks = [self._tracks(utterance) for utterance in corpus]
        self.network = network(self.hearing.mel.bands, self.pca.basis.shape[1], seed)
        self.facts = {"loss": _train(self.network, tracks, self.steps, seed)}
        return self.eval()

    @torch.no_grad()
    def synthesize(self, speech: Speech, *, seed: int = 0, **options: Any) -> Motion:
        """Motion predicted at RATE, between its frames a cubic spline."""
        refuse_options(self.name, options)
        layout = self.fitted_layout
        times_s = np.arange(int(np.ceil(speech.duration_s * RATE)) + 1) / RATE
        heard = self.hearing.at(speech, times_s).T[None]  # [1, 40, F]
        coordinates = self.network(heard)[0].T * self.scale
        frames = CubicSpline(times_s, self.pca.decode(coordinates).cpu().numpy(), axis=0)
        return Motion(frames(np.arange(speech.phones.frame_bounds(self.fps)[-1]) / self.fps).astype(np.float32), self.fps, layout)

    def _tracks(self, utterance: Utterance) -> Tracks:
        motion = utterance.motion
        present = complete(motion.frames)
        times_s = np.arange(int(motion.duration_s * RATE) + 1) / RATE
        nearest = np.minimum(np.round(times_s * motion.fps).astype(np.int64), len(motion) - 1)
        if not present.any():
            empty = torch.zeros(len(times_s), self.pca.basis.shape[1])
            return Tracks(self.hearing.at(utterance.speech, times_s), empty, torch.zeros(len(times_s)))
        known = self.pca.encode(torch.from_numpy(motion.frames[present])).numpy() / self.scale.numpy()
        moved = [np.interp(times_s, motion.times_s[present], column) for column in known.T]
        return Tracks(
            self.hearing.at(utterance.speech, times_s),
            torch.from_numpy(np.stack(moved, axis=1)).float(),
            torch.from_numpy(present[nearest]).float(),
        )


def network(inputs: int, outputs: int, seed: int) -> nn.Sequential:
    """[B, inputs, F] to [B, outputs, F]; first weights by seed, torch's own generator stays as it was."""
    layers: list[nn.Module] = []
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        for before, dilation in zip((inputs, WIDTH, WIDTH, WIDTH), DILATIONS, strict=True):
            layers += [nn.Conv1d(before, WIDTH, KERNEL, padding="same", dilation=dilation), nn.ReLU(), nn.Dropout(DROPOUT)]
        return nn.Sequential(*layers, nn.Conv1d(WIDTH, outputs, 1))


def _train(model: nn.Sequential, tracks: list[Tracks], steps: int, seed: int) -> float:
    """Learn, and return the mean loss of the last tenth of the steps."""
    if steps < 1:
        raise FacesynthError(f"tcn needs at least one step of training; got {steps}")
    optimiser = torch.optim.AdamW(model.parameters(), LEARNING_RATE, weight_decay=WEIGHT_DECAY)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    rng, losses = np.random.default_rng(seed), []
    model.train()
    with torch.random.fork_rng(devices=[]):  # dropout draws from torch's own generator
        torch.manual_seed(seed)
        for _ in track(range(steps), "tcn: learning", steps):
            loss = _loss(model, _batch(tracks, rng))
            optimiser.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]  # torch leaves it untyped
            optimiser.step()
            schedule.step()
            losses.append(float(loss.detach()))
    return float(np.mean(losses[-max(1, steps // 10) :]))


def _loss(model: nn.Sequential, batch: Tracks) -> Tensor:
    """Mean squared error of the frames that were recorded."""
    squared = (model(batch.heard.transpose(1, 2)).transpose(1, 2) - batch.moved).square().sum(dim=2)
    return (squared * batch.present).sum() / batch.present.sum().clamp(min=1)


def _batch(tracks: list[Tracks], rng: np.random.Generator) -> Tracks:
    """BATCH windows [BATCH, WINDOW, ...] of utterances drawn in proportion to their length; short ones end in silence."""
    lengths = np.array([len(track.heard) for track in tracks])
    chosen = rng.choice(len(tracks), BATCH, p=lengths / lengths.sum())
    starts = [int(rng.integers(max(lengths[i] - WINDOW, 0) + 1)) for i in chosen]
    windows = [[_window(signal, start) for signal in tracks[i]] for i, start in zip(chosen, starts, strict=True)]
    return Tracks(*(torch.stack(signals) for signals in zip(*windows, strict=True)))


def _window(signal: Tensor, start: int) -> Tensor:
    """WINDOW frames of [F, ...] from `start`, zeros after its end."""
    piece = signal[start : start + WINDOW]
    return torch.cat([piece, piece.new_zeros(WINDOW - len(piece), *piece.shape[1:])])
