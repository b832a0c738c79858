"""Ridge: what a linear map from sound to motion reaches."""

from typing import Any, Self

import numpy as np
import torch
from torch import Tensor

from facesynth.corpus import Corpus
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion
from facesynth.inference.speech import Speech
from facesynth.methods.baselines.capabilities import RIDGE
from facesynth.methods.learn.frames import complete, complete_frames
from facesynth.methods.learn.hearing import Features, Hearing
from facesynth.methods.learn.regression import Moments
from facesynth.methods.method import Method
from facesynth.methods.registry import register
from facesynth.motion.pca import Pca
from facesynth.progress import track

SIDE_S = 0.2
"""How far before and after a frame the sound is heard, s."""
TIMES, WIDE_TIMES = 21, 11
"""How many times the sound is heard around a frame: log-mel bands, and features that hold a layer of the phone network. That
looks around itself: every 20 ms is no nearer to unseen clips than every 40 ms."""
NARROW, LOOKED_AT = 80, 4
"""Principal components of such features that are heard, learned from every so many-th frame of them: least squares over all 184
are 0.04 mm nearer (GRID s1, 40 unseen clips) and take twelve times as long."""
ALPHAS = 10.0 ** np.arange(-6, 2.1, 0.5)
"""Penalties tried, as shares of the mean variance of an input."""
HELD_OUT_SHARE = 0.2
"""Share of the sentences that choose the penalty."""


@register(RIDGE)
class Ridge(Method):
    """Linear regression from sound to 25 principal components of the motion.

    Heard are 40 log-mel bands beside a layer of the phone network, or one of them (see `Hearing`), over ±200 ms around a frame.

    The penalty is the one that predicts a fifth of the training sentences best from the others; the weights are then
    learned from all.
    """

    weights: Tensor
    """[N W, D] of W features at N times."""
    bias: Tensor
    """[D]"""

    def __init__(self, components: int = 25, features: Features = "both") -> None:
        super().__init__()
        self.components = components
        self.hearing = Hearing(features)
        self.pca = Pca(torch.zeros(0), torch.zeros(0, 0), torch.zeros(0))
        self.narrow = Pca(torch.zeros(0), torch.zeros(0, 0), torch.zeros(0))
        self.register_buffer("weights", torch.zeros(0, 0))
        self.register_buffer("bias", torch.zeros(0))

    def fit(self, corpus: Corpus, *, seed: int = 0) -> Self:
        """Learn from the complete frames of a corpus; FacesynthError where it has a single sentence."""
        self.learned_from(corpus)
        held_out = _held_out(corpus, seed)
        self.pca = Pca.fit(complete_frames(corpus), self.components).to(self.device)
        self._learn_to_hear(corpus)
        parts = self._moments(corpus, held_out)
        together = parts[0] + parts[1]
        errors = [parts[1].error(*weights) for weights in parts[0].solutions(ALPHAS)]
        best = int(np.argmin(errors))
        weights, bias = together.solution(ALPHAS[best])
        self.weights, self.bias = (torch.from_numpy(a).float().to(self.device) for a in (weights, bias))
        self.facts = {"alpha": float(ALPHAS[best]), "held_out_rms": float(np.sqrt(errors[best]))}
        return self.eval()

    def synthesize(self, speech: Speech, *, seed: int = 0, **options: Any) -> Motion:
        """Motion predicted frame by frame."""
        self.refuse(options)
        layout = self.fitted_layout
        count = int(speech.phones.frame_bounds(self.fps)[-1])
        times = len(self.weights) // self._width
        frames = self.pca.decode(self._heard(speech, count, times) @ self.weights + self.bias)
        return Motion(frames.cpu().numpy(), self.fps, layout)

    def _learn_to_hear(self, corpus: Corpus) -> None:
        self.narrow = Pca(torch.zeros(0), torch.zeros(0, 0), torch.zeros(0))
        self.hearing.learn(corpus)
        if self.hearing.width > NARROW:
            standard = self.hearing.standard()
            seen = [self.hearing.bands(utterance.speech)[::LOOKED_AT] for utterance in corpus]
            self.narrow = Pca.fit((np.concatenate(seen) - standard.mean) / standard.deviation, NARROW).to(self.device)

    @property
    def _width(self) -> int:
        """W of what is heard at one time."""
        return self.narrow.basis.shape[1] or self.hearing.width

    def _heard(self, speech: Speech, count: int, times: int) -> Tensor:
        """[T, N W] features at N times around each of `count` frames."""
        around_s = np.linspace(-SIDE_S, SIDE_S, times)
        heard = self.hearing.at(speech, (np.arange(count) / self.fps)[:, None] + around_s)
        return (self.narrow.encode(heard) if self.narrow.basis.numel() else heard).flatten(1)

    def _moments(self, corpus: Corpus, held_out: frozenset[str]) -> tuple[Moments, Moments]:
        """Sums over the sentences to learn from, and over those held out."""
        times = WIDE_TIMES if self.narrow.basis.numel() else TIMES
        inputs, outputs = self._width * times, self.pca.basis.shape[1]
        parts = Moments.zero(inputs, outputs), Moments.zero(inputs, outputs)
        for utterance in track(corpus, "ridge: listening", len(corpus)):
            present = complete(utterance.motion.frames)
            heard = self._heard(utterance.speech, len(utterance.motion), times)[present]
            moved = self.pca.encode(torch.from_numpy(utterance.motion.frames[present]).to(self.device))
            parts[utterance.sentence in held_out].add(heard.cpu().numpy(), moved.cpu().numpy())
        return parts


def _held_out(corpus: Corpus, seed: int) -> frozenset[str]:
    sentences = sorted({record.sentence_key for record in corpus.usable_records})
    if len(sentences) < 2:
        raise FacesynthError(
            f"ridge chooses its penalty on held-out sentences and needs at least two; got {len(sentences)}: record more"
        )
    count = max(1, round(HELD_OUT_SHARE * len(sentences)))
    return frozenset(np.random.default_rng(seed).permutation(np.array(sentences, object))[:count])
