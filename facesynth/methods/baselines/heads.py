"""Heads that every other head is judged beside: one that rests, and one that a linear map moves by prosody."""

from typing import Any, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from facesynth.corpus import Corpus
from facesynth.inference.arrays import Floats
from facesynth.inference.head.voice import prosody_of
from facesynth.inference.motion import Motion
from facesynth.inference.speech import Speech
from facesynth.methods.baselines.capabilities import HEAD_REST, HEAD_RIDGE
from facesynth.methods.learn.heads import mean_head, poses_of, prosody_windows, still_face, with_head
from facesynth.methods.learn.regression import Moments
from facesynth.methods.method import Method
from facesynth.methods.registry import register

AROUND_S = np.linspace(-0.4, 0.4, 9)
"""Where around a frame prosody is heard, s."""
PENALTY = 0.03
"""Share of the mean variance of an input; it hardly matters."""
DIFFERENCE_S = 1 / 8
"""Differences of prosody are taken as over so long a time, so that they are of the size of what they are differences of."""


@register(HEAD_REST)
class HeadRest(Method):
    """The head rests in the mean of all recorded poses."""

    frame: Tensor
    """[C] the face at rest."""
    pose: Tensor
    """[6] rotation vector (rad) and translation (mm)."""

    def __init__(self) -> None:
        super().__init__()
        for name in ("frame", "pose"):
            self.register_buffer(name, torch.zeros(0))

    def fit(self, corpus: Corpus, *, seed: int = 0) -> Self:
        """Take the mean; FacesynthError for fewer than two recordings with a head."""
        self.learned_from(corpus)
        device, recordings = self.device, with_head(corpus)
        self.frame, self.pose = (_tensor(a).to(device) for a in (still_face(corpus), mean_head(recordings)))
        return self.eval()

    def synthesize(self, speech: Speech, *, seed: int = 0, **options: Any) -> Motion:
        """The mean pose, for as long as the phones last."""
        self.refuse(options)
        count = _count(self, speech)
        return _moved(self, self.frame, self.pose.expand(count, 6))


@register(HEAD_RIDGE)
class HeadRidge(Method):
    """Linear regression from six prosodic features at nine times within 0.4 s to the head's pose."""

    frame: Tensor
    """[C] the face at rest."""
    weights: Tensor
    """[54, 6]"""
    bias: Tensor
    """[6]"""

    def __init__(self) -> None:
        super().__init__()
        for name in ("frame", "weights", "bias"):
            self.register_buffer(name, torch.zeros(0))

    def fit(self, corpus: Corpus, *, seed: int = 0) -> Self:
        """Learn from the recordings in which the head's pose is known; FacesynthError for fewer than two."""
        self.learned_from(corpus)
        device, recordings = self.device, with_head(corpus)
        sums = Moments.zero(6 * len(AROUND_S), 6)
        for utterance in recordings:
            heard = _heard(utterance.speech, corpus.fps, len(utterance.motion))
            sums.add(heard.astype(np.float32), poses_of(utterance).astype(np.float32))
        ((weights, bias),) = sums.solutions([PENALTY])
        self.frame, self.weights, self.bias = (_tensor(a).to(device) for a in (still_face(corpus), weights, bias))
        return self.eval()

    def synthesize(self, speech: Speech, *, seed: int = 0, **options: Any) -> Motion:
        """Poses predicted frame by frame."""
        self.refuse(options)
        heard = _tensor(_heard(speech, self.fps, _count(self, speech))).to(self.weights)
        return _moved(self, self.frame, heard @ self.weights + self.bias)


def _heard(speech: Speech, fps: float, count: int) -> Floats:
    """[T, 54] prosody around each frame."""
    prosody = prosody_of([prosody_windows(speech, fps, count)], fps)
    prosody = prosody * np.repeat([1.0, 1 / fps / DIFFERENCE_S, (1 / fps / DIFFERENCE_S) ** 2], 2)
    at = np.arange(len(prosody))[:, None] + np.round(AROUND_S * fps).astype(np.int64)
    return prosody[np.clip(at, 0, len(prosody) - 1)].reshape(len(prosody), -1)


def _count(method: Method, speech: Speech) -> int:
    """Frames; FacesynthError where the method is not trained."""
    _ = method.fitted_layout
    return int(speech.phones.frame_bounds(method.fps)[-1])


def _moved(method: Method, frame: Tensor, head: Tensor) -> Motion:
    frames = np.tile(frame.cpu().numpy(), (len(head), 1))
    return Motion(frames, method.fps, method.fitted_layout, np.ascontiguousarray(head.cpu().numpy(), np.float32))


def _tensor(array: NDArray[Any]) -> Tensor:
    return torch.from_numpy(np.ascontiguousarray(array, np.float32))
