"""The small network: four 1-D convolutions over frames of sound, and how it is trained."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from facesynth.methods.learn import trainer
from facesynth.methods.learn.trainer import Learning

RATE = 50.0
"""Frames that the network reads per second, Hz: the 20 ms of the ridge's 21 frames."""
WIDTH, KERNEL, DROPOUT = 128, 5, 0.3
DILATIONS = (1, 1, 2, 2)
"""Reach 12 frames to either side: ±240 ms."""
STEPS, BATCH, WINDOW = 600, 16, 96
"""Of the training: steps unless told otherwise, windows of a step, frames of a window."""
LEARNING_RATE, WEIGHT_DECAY = 2e-3, 1e-2


class Tracks(NamedTuple):
    """One utterance at RATE."""

    heard: Tensor
    """[F, inputs] sound, and what else the network is told."""
    moved: Tensor
    """[F, D] motion, in units of its largest standard deviation."""
    present: Tensor
    """[F] 1 where the recording has a complete frame, 0 elsewhere."""


def network(inputs: int, outputs: int, seed: int) -> nn.Sequential:
    """[B, inputs, F] to [B, outputs, F]; first weights by seed, torch's own generator stays as it was."""
    layers: list[nn.Module] = []
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        for before, dilation in zip((inputs, WIDTH, WIDTH, WIDTH), DILATIONS, strict=True):
            layers += [nn.Conv1d(before, WIDTH, KERNEL, padding="same", dilation=dilation), nn.ReLU(), nn.Dropout(DROPOUT)]
        return nn.Sequential(*layers, nn.Conv1d(WIDTH, outputs, 1))


def train(model: nn.Sequential, tracks: Sequence[Tracks], steps: int, seed: int, what: str) -> float:
    """AdamW on the squared error over random windows, the learning rate falling along a cosine.

    Returns the mean loss of the last tenth of the steps. `what` is told beside the progress.
    """
    optimiser = torch.optim.AdamW(model.parameters(), LEARNING_RATE, weight_decay=WEIGHT_DECAY)
    learning = Learning(steps, optimiser, torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps))
    losses = list(trainer.train(model, lambda rng: _loss(model, _batch(tracks, rng)), learning, seed, what))
    return float(np.mean(losses[-max(1, steps // 10) :]))


def _loss(model: nn.Sequential, batch: Tracks) -> Tensor:
    """Mean squared error of the frames that were recorded."""
    squared = (model(batch.heard.transpose(1, 2)).transpose(1, 2) - batch.moved).square().sum(dim=2)
    return (squared * batch.present).sum() / batch.present.sum().clamp(min=1)


def _batch(tracks: Sequence[Tracks], rng: np.random.Generator) -> Tracks:
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
