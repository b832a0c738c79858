"""What the sound and the phones together lead one to expect of the face: a small network, learned with the database.

It predicts the average, which moves too little; the search uses it to tell which captured nodes fit what is heard.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch
from scipy.interpolate import CubicSpline
from torch import Tensor, nn

from facesynth.corpus import Corpus, Utterance
from facesynth.inference.phones import PHONES
from facesynth.inference.speech import Speech
from facesynth.methods.baselines.tcn import network
from facesynth.methods.efase.nodes import Floats, Ints
from facesynth.methods.learn.frames import complete
from facesynth.methods.learn.hearing import Hearing
from facesynth.motion.resample import resample
from facesynth.progress import track

RATE = 50.0
"""Frames that the network reads per second, Hz."""
STEPS, BATCH, WINDOW = 600, 16, 96
"""Of the training: steps, windows of a step, frames of a window."""
LEARNING_RATE, WEIGHT_DECAY = 2e-3, 1e-2
PHONE_SIZE = 2.0
"""How loud a phone is beside the standardised bands of the sound."""


class Tracks(NamedTuple):
    """One utterance at RATE."""

    heard: Tensor
    """[F, 40 + phones + emotions]"""
    moved: Tensor
    """[F, D] motion, in units of its largest standard deviation."""
    present: Tensor
    """[F] 1 where the recording is complete, 0 elsewhere."""


class PosePredictor(nn.Module):
    """From log-mel bands, phones and emotion to coordinates of the motion: four 1-D convolutions that reach ±240 ms."""

    scale: Tensor
    """[1] largest standard deviation of a coordinate."""
    metric: Tensor
    """[D] how much a squared difference of each coordinate counts."""

    def __init__(self) -> None:
        super().__init__()
        self.hearing = Hearing()
        self.network = network(1, 1, seed=0)
        self.register_buffer("scale", torch.ones(1))
        self.register_buffer("metric", torch.ones(0))

    def learn(self, corpus: Corpus, encode: Callable[[Tensor], Tensor], seed: int) -> None:
        """AdamW on the squared error of the complete frames; the same seed gives the same weights on one machine.

        encode: frames [T, C] to the coordinates [T, D] that are to be predicted, whose distances are those of frames.
        """
        self.hearing.learn(corpus)
        tracks = [self._tracks(utterance, corpus.emotions, encode) for utterance in corpus]
        everything = torch.cat([t.moved[t.present > 0] for t in tracks])
        self.scale = everything.std(dim=0).max().clamp(min=1e-6).reshape(1)
        self.metric = torch.ones(everything.shape[1])
        tracks = [t._replace(moved=t.moved / self.scale) for t in tracks]
        self.network = network(tracks[0].heard.shape[1], everything.shape[1], seed)
        _train(self.network, tracks, seed)
        self.eval()

    @torch.no_grad()
    def at(self, speech: Speech, emotions: Ints, emotion_count: int, fps: float, count: int) -> Floats:
        """[count, D] coordinates at `fps`; emotions [P] the index of each phone's emotion."""
        times_s = np.arange(int(np.ceil(count / fps * RATE)) + 2) / RATE
        heard = self._heard(speech, emotions, emotion_count, times_s)
        predicted = (self.network(heard.T[None])[0].T * self.scale).cpu().numpy().astype(np.float64)
        return np.asarray(CubicSpline(times_s, predicted, axis=0)(np.arange(count) / fps))

    def _heard(self, speech: Speech, emotions: Ints, emotion_count: int, times_s: Floats) -> Tensor:
        phones = speech.phones
        number = np.minimum(np.searchsorted(phones.ends_s, times_s, side="right"), len(phones) - 1)
        said = np.array([PHONES.index(label) for label in phones.labels])[number]
        bands = self.hearing.at(speech, times_s)
        labels = torch.from_numpy(np.hstack([PHONE_SIZE * np.eye(len(PHONES))[said], np.eye(emotion_count)[emotions[number]]]))
        return torch.cat([bands, labels.to(bands)], dim=1)

    def _tracks(self, utterance: Utterance, emotions: tuple[str, ...], encode: Callable[[Tensor], Tensor]) -> Tracks:
        speech, motion = utterance.speech, resample(utterance.motion, RATE)
        felt = np.array([emotions.index(e) for e in speech.emotions.per_phone(speech.phones)[0]])
        heard = self._heard(speech, felt, len(emotions), np.arange(len(motion)) / RATE)
        present = torch.from_numpy(complete(motion.frames))
        moved = encode(torch.from_numpy(np.nan_to_num(motion.frames))).float()
        return Tracks(heard, moved * present[:, None], present.float())


def _train(model: nn.Sequential, tracks: list[Tracks], seed: int) -> None:
    optimiser = torch.optim.AdamW(model.parameters(), LEARNING_RATE, weight_decay=WEIGHT_DECAY)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, STEPS)
    rng = np.random.default_rng(seed)
    model.train()
    with torch.random.fork_rng(devices=[]):  # dropout draws from torch's own generator
        torch.manual_seed(seed)
        for _ in track(range(STEPS), "learning what is expected", STEPS):
            heard, moved, present = _batch(tracks, rng)
            squared = (model(heard.transpose(1, 2)).transpose(1, 2) - moved).square().sum(dim=2)
            loss = (squared * present).sum() / present.sum().clamp(min=1)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()


def _batch(tracks: list[Tracks], rng: np.random.Generator) -> Tracks:
    """BATCH windows [BATCH, WINDOW, ...] of utterances drawn in proportion to their length."""
    lengths = np.array([len(track.heard) for track in tracks])
    windows = []
    for i in rng.choice(len(tracks), BATCH, p=lengths / lengths.sum()):
        start = int(rng.integers(max(lengths[i] - WINDOW, 0) + 1))
        short = max(WINDOW - int(lengths[i]), 0)
        pieces = [signal[start : start + WINDOW] for signal in tracks[i]]
        windows.append([torch.cat([piece, piece.new_zeros(short, *piece.shape[1:])]) for piece in pieces])
    return Tracks(*(torch.stack(signals) for signals in zip(*windows, strict=True)))
