"""What the sound and the phones together lead one to expect of the face: a small network, learned with the database.

It predicts the average, which moves too little; the search uses it to tell which captured nodes fit what is heard.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from torch import Tensor, nn

from facesynth.corpus import Corpus, Utterance
from facesynth.inference.phones import PHONES
from facesynth.inference.speech import Speech
from facesynth.methods.learn.frames import complete
from facesynth.methods.learn.hearing import Hearing
from facesynth.methods.learn.network import RATE, STEPS, Tracks, network, train
from facesynth.motion.resample import resample

PHONE_SIZE = 2.0
"""How loud a phone is beside the standardised bands of the sound."""


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
        train(self.network, tracks, STEPS, seed, "learning what is expected")
        self.eval()

    @torch.no_grad()
    def at(self, speech: Speech, emotions: NDArray[np.int64], emotion_count: int, fps: float, count: int) -> NDArray[np.float64]:
        """[count, D] coordinates at `fps`; emotions [P] the index of each phone's emotion."""
        times_s = np.arange(int(np.ceil(count / fps * RATE)) + 2) / RATE
        heard = self._heard(speech, emotions, emotion_count, times_s)
        predicted = (self.network(heard.T[None])[0].T * self.scale).cpu().numpy().astype(np.float64)
        return np.asarray(CubicSpline(times_s, predicted, axis=0)(np.arange(count) / fps))

    def _heard(self, speech: Speech, emotions: NDArray[np.int64], emotion_count: int, times_s: NDArray[np.float64]) -> Tensor:
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
