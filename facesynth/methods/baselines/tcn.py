"""A small temporal convolution network: what a user would train instead."""

from typing import Any, Self

import numpy as np
import torch
from torch import Tensor

from facesynth.corpus import Corpus, Utterance
from facesynth.inference.errors import FacesynthError
from facesynth.inference.filters import spline_at
from facesynth.inference.motion import Motion
from facesynth.inference.speech import Speech
from facesynth.methods.baselines.capabilities import TCN
from facesynth.methods.learn.frames import complete, complete_frames
from facesynth.methods.learn.hearing import Features, Hearing
from facesynth.methods.learn.network import RATE, STEPS, Tracks, network, train
from facesynth.methods.method import Method
from facesynth.methods.registry import register
from facesynth.motion.pca import Pca


@register(TCN)
class Tcn(Method):
    """Four 1-D convolutions, 128 wide, kernel 5, dilation up to 2, dropout 0.3, from log-mel bands and a layer of the
    phone network (or one of them, see `Hearing`) to 25 components.

    AdamW on the squared error over random windows, the learning rate falling along a cosine. The same seed gives the
    same weights on the same machine with the same number of threads.
    """

    scale: Tensor
    """[1] standard deviation of the first component, unit of the layout."""

    def __init__(self, components: int = 25, steps: int = STEPS, features: Features = "both") -> None:
        super().__init__()
        if steps < 1:
            raise FacesynthError(f"tcn needs at least one step of training; got {steps}")
        self.components, self.steps = components, steps
        self.hearing = Hearing(features)
        self.pca = Pca(torch.zeros(0), torch.zeros(0, 0), torch.zeros(0))
        self.network = network(self.hearing.width, components, seed=0)
        self.register_buffer("scale", torch.ones(1))

    def fit(self, corpus: Corpus, *, seed: int = 0) -> Self:
        """Learn from the complete frames of a corpus."""
        self.learned_from(corpus)
        frames = complete_frames(corpus)
        self.pca = Pca.fit(frames, self.components).to(self.device)
        self.hearing.learn(corpus)
        self.scale = self.pca.encode(torch.from_numpy(frames).to(self.device)).std(dim=0).max().clamp(min=1e-6).reshape(1)
        tracks = [self._tracks(utterance) for utterance in corpus]
        self.network = network(self.hearing.width, self.pca.basis.shape[1], seed).to(self.device)
        self.facts = {"loss": train(self.network, tracks, self.steps, seed, "tcn: learning")}
        return self.eval()

    @torch.no_grad()
    def synthesize(self, speech: Speech, *, seed: int = 0, **options: Any) -> Motion:
        """Motion predicted at RATE, between its frames a cubic spline."""
        self.refuse(options)
        layout = self.fitted_layout
        times_s = np.arange(int(np.ceil(speech.duration_s * RATE)) + 1) / RATE
        heard = self.hearing.at(speech, times_s).T[None]  # [1, W, F]
        coordinates = self.network(heard)[0].T * self.scale
        poses = self.pca.decode(coordinates).cpu().numpy().astype(np.float64)
        frames = spline_at(poses, np.arange(speech.phones.frame_bounds(self.fps)[-1]) / self.fps * RATE)
        return Motion(frames.astype(np.float32), self.fps, layout)

    def _tracks(self, utterance: Utterance) -> Tracks:
        motion = utterance.motion
        present = complete(motion.frames)
        times_s = np.arange(int(motion.duration_s * RATE) + 1) / RATE
        nearest = np.minimum(np.round(times_s * motion.fps).astype(np.int64), len(motion) - 1)
        heard = self.hearing.at(utterance.speech, times_s)
        if not present.any():
            return Tracks(heard, heard.new_zeros(len(times_s), self.pca.basis.shape[1]), heard.new_zeros(len(times_s)))
        known = (self.pca.encode(torch.from_numpy(motion.frames[present]).to(self.device)) / self.scale).cpu().numpy()
        moved = [np.interp(times_s, motion.times_s[present], column) for column in known.T]
        return Tracks(
            heard,
            torch.from_numpy(np.stack(moved, axis=1)).to(heard),
            torch.from_numpy(present[nearest]).to(heard),
        )
