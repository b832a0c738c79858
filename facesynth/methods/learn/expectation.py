"""What the sound and the phones together lead one to expect of the face: a small network, learned with the database.

It predicts the average, which moves too little; the search uses it to tell which captured nodes fit what is heard.
"""

from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from facesynth.corpus import Corpus, Utterance
from facesynth.inference.expectation import Expectation, Single, heard
from facesynth.inference.phones import PHONES
from facesynth.methods.learn.frames import complete
from facesynth.methods.learn.hearing import Hearing
from facesynth.methods.learn.network import RATE, STEPS, Tracks, network, train
from facesynth.motion.resample import resample


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
        self.metric = everything.new_ones(everything.shape[1])
        tracks = [t._replace(moved=t.moved / self.scale) for t in tracks]
        self.network = network(tracks[0].heard.shape[1], everything.shape[1], seed).to(self.scale.device)
        train(self.network, tracks, STEPS, seed, "learning what is expected")
        self.eval()

    @torch.no_grad()
    def forward(self, told: Tensor) -> Tensor:
        """[F, 40 + phones + emotions] what the network is told to coordinates [F, D]."""
        predicted: Tensor = self.network(told.T[None])[0].T * self.scale
        return predicted

    def expectation(self, emotion_count: int) -> Expectation:
        """What a search takes of it."""

        def predict(told: Single) -> Single:
            found: Single = self(torch.from_numpy(told).to(self.scale.device)).cpu().numpy()
            return found

        return Expectation(predict, self.hearing.standard(), emotion_count)

    def _tracks(self, utterance: Utterance, emotions: tuple[str, ...], encode: Callable[[Tensor], Tensor]) -> Tracks:
        speech, motion = utterance.speech, resample(utterance.motion, RATE)
        said = [PHONES.index(label) for label in speech.phones.labels]
        felt = [emotions.index(e) for e in speech.emotions.per_phone(speech.phones)[0]]
        bands, times_s = self.hearing.bands(speech), np.arange(len(motion)) / RATE
        told: NDArray[np.float32] = heard(
            bands, said, speech.phones.ends_s, felt, times_s, self.hearing.standard(), len(emotions)
        )
        frames, present, said_and_heard = (
            torch.from_numpy(array).to(self.scale.device)
            for array in (np.nan_to_num(motion.frames), complete(motion.frames), told)
        )
        return Tracks(said_and_heard, encode(frames).float() * present[:, None], present.float())
