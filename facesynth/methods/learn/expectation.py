"""The expected pose: one network for every method that expects one, and for the method that shows nothing else.

It predicts the pose in the middle of those that a sound may go with, which moves too little; a search uses it to tell which
captured nodes fit what is heard.
"""

from collections.abc import Callable
from copy import deepcopy
from functools import partial
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from facesynth.corpus import Corpus, Utterance
from facesynth.inference.expectation import EACH, Expectation, Reading, Said, Single, linear_at, rate_of
from facesynth.inference.layout import Layout
from facesynth.inference.sound import resample, resampled_length
from facesynth.methods.learn import trainer
from facesynth.methods.learn.frames import complete, complete_frames
from facesynth.methods.learn.hearing import Features, Hearing
from facesynth.methods.learn.linear_path import LinearPath
from facesynth.methods.learn.other_voices import RATE as VOICES_HZ
from facesynth.methods.learn.other_voices import Change, other_voice
from facesynth.methods.learn.point_loss import PointLoss
from facesynth.methods.learn.pose_network import REACH, PoseNetwork, frames_ahead
from facesynth.methods.learn.spreading import in_pieces
from facesynth.methods.learn.trainer import Learning
from facesynth.methods.learn.windows import Recording, Windows
from facesynth.motion.pca import Pca

BANDS = 64
"""Of the sound."""
COMPONENTS = 30
"""Of the motion, that are predicted."""
STEPS = 700
"""Of the training, unless told otherwise."""
LEARNING_RATE, WEIGHT_DECAY, WARMING = 2e-3, 1e-2, 0.1
"""The rate rises over this share of the steps and then falls along a cosine."""
LARGEST_GRADIENT = 1.0
AVERAGED, SETTLING = 0.99, 10
"""Weights are averaged over about a hundred steps, fewer at the start."""
OTHER_VOICES = 17
"""Beside the seed: of the draws that change sounds."""

Bands = NDArray[Any]


class PosePredictor(nn.Module):
    """From sound, phones and emotion to the pose that is to be expected, and how sure that is.

    features: what is heard, see `Hearing`. phones: whether the network is told what is said. look_ahead_s: how much of the
    sound after a frame it may hear; None for as much as it hears before (0.7 s at 25 frames a second). voices: how many changed
    sounds of each recording (see `other_voices`) it learns from as well, for voices, microphones and rooms that are not the
    talker's. unsaid: the share of what it learns from of which it is not told what is said.
    """

    fps: Tensor
    """[1] rate of the motion that was learned, Hz."""
    emotion_count: Tensor
    """[1] emotions that it knows."""
    scale: Tensor
    """[1] standard deviation of the first component."""
    into: Tensor
    """[R, D] components to the coordinates that were asked for …"""
    onto: Tensor
    """[D] … and where these are when all components are 0."""
    metric: Tensor
    """[D] how much a squared difference of each coordinate counts."""

    def __init__(
        self,
        features: Features = "log_mel",
        *,
        phones: bool = True,
        look_ahead_s: float | None = None,
        voices: int = 0,
        unsaid: float = 0.0,
    ) -> None:
        super().__init__()
        self.phones, self.look_ahead_s, self.voices, self.unsaid = phones, look_ahead_s, voices, unsaid
        self.hearing = Hearing(features, BANDS)
        self.pca = _no_components()
        self.network = PoseNetwork(1, 1)
        self.linear = LinearPath()
        for name, start in (("scale", torch.ones(1)), ("into", torch.zeros(0, 0)), ("onto", torch.zeros(0))):
            self.register_buffer(name, start)
        self.register_buffer("metric", torch.ones(0))
        self.register_buffer("fps", torch.full((1,), 25.0, dtype=torch.float64))
        self.register_buffer("emotion_count", torch.ones(1, dtype=torch.int64))

    def learn(self, corpus: Corpus, encode: Callable[[Tensor], Tensor], seed: int, steps: int | None = None) -> None:
        """Prepare, then train; the same seed gives the same weights on one machine with the same number of threads.

        encode: frames [T, C] to the coordinates [T, D] that are asked for, an affine map.
        """
        windows = self.prepare(corpus, seed)
        self.learn_beside(windows)
        self.answer_in(encode)
        self.network = train(self.network, self.loss(corpus.layout), windows, steps or STEPS, seed)
        self.pca = _no_components()  # `into` and `onto` say the rest
        self.eval()

    def prepare(self, corpus: Corpus, seed: int) -> Windows:
        """Everything but what is learned from windows: the network's weights, which start anew, and the regression beside it."""
        device = self.scale.device
        self.fps = torch.full_like(self.fps, corpus.fps)
        self.emotion_count = torch.full_like(self.emotion_count, len(corpus.emotions))
        self.hearing.begin()
        heard = self.heard(corpus, seed)
        self.hearing.standardise(bands for each in heard for bands in each)
        frames = complete_frames(corpus)
        self.pca = Pca.fit(frames, COMPONENTS).to(device)
        self.scale = self.pca.encode(torch.from_numpy(frames).to(device)).std(dim=0).max().clamp(min=1e-6).reshape(1)
        self.into, self.onto = self.scale * self.pca.basis.T, self.pca.mean.clone()
        columns = self.read_by_network()
        inputs = len(columns) or self.reading.width
        self.network = PoseNetwork(inputs, self.pca.basis.shape[1], seed=seed, columns=columns).to(device)
        recordings = [self.recording(*one, corpus.emotions) for one in zip(corpus, heard, strict=True)]
        return Windows(recordings, self.reading, self.ahead, self.unsaid, BANDS if len(columns) else None)

    def learn_beside(self, windows: Windows) -> None:
        """The linear regression that what is expected is a share of; none where log-mel bands alone are heard."""
        if self.hearing.features != "log_mel":
            self.linear.learn(windows.recordings, self.reading, self.ahead)

    def read_by_network(self) -> Tensor:
        """Columns of what is told that the network reads: all of them (an empty list), or all but the phone network's layer.

        Told of both, it would learn the layer by heart; the regression beside it bears that.
        """
        reading = self.reading
        count = len(reading.standard.mean)
        if self.hearing.features != "both":
            return torch.zeros(0, dtype=torch.int64)
        heard = torch.arange(EACH * count).reshape(EACH, count)[:, :BANDS].flatten()
        return torch.cat([heard, torch.arange(EACH * count, reading.width)])

    def heard(self, corpus: Corpus, seed: int) -> list[list[Bands]]:
        """Features [F, B] of each recording, and of `voices` changed sounds of it."""
        listen = partial(_heard, self.hearing, corpus, self.voices)
        return list(in_pieces(listen, self._drawn(corpus, np.random.default_rng([seed, OTHER_VOICES])), "listening"))

    def _drawn(self, corpus: Corpus, rng: np.random.Generator) -> list[tuple[str, dict[str, Any]]]:
        """Each recording with what the generator is at when its voices are drawn, one recording after the other."""
        states = []
        for utterance in corpus if self.voices else ():
            states.append(dict(rng.bit_generator.state))
            length = resampled_length(len(utterance.speech.audio), utterance.speech.sample_rate, VOICES_HZ)
            for _ in range(self.voices):
                Change.drawn(length, rng)
        return list(zip(corpus.ids, states or [{}] * len(corpus), strict=True))

    def loss(self, layout: Layout) -> PointLoss:
        """What is to be made small."""
        return PointLoss(layout, self.pca.basis * self.scale, float(self.scale) / len(layout.names) ** 0.5)

    def answer_in(self, encode: Callable[[Tensor], Tensor]) -> None:
        """Let what the network says be told in other coordinates than frames: the affine map of frames that `encode` is."""
        onto = encode(self.onto[None])[0].float()
        self.into, self.onto = (encode(self.onto + self.into) - onto).float(), onto.clone()
        self.metric = self.onto.new_ones(len(self.onto))

    @property
    def reading(self) -> Reading:
        """What the network is told."""
        return Reading(self.hearing.standard(), rate_of(float(self.fps)), self.phones, int(self.emotion_count))

    @property
    def ahead(self) -> int:
        """Frames by which its input runs ahead."""
        return frames_ahead(self.look_ahead_s, rate_of(float(self.fps)))

    @torch.no_grad()
    def forward(self, told: Tensor) -> Tensor:
        """[F, W] what the network is told to coordinates [F, D]."""
        components = self.network(told[None])[0][0]
        if self.linear.learned:
            components = components.lerp(self.linear(told, self.ahead), self.linear.share)
        poses: Tensor = components @ self.into + self.onto
        return poses

    def expectation(self) -> Expectation:
        """What a search takes of it."""

        def predict(told: Single) -> Single:
            found: Single = self(torch.from_numpy(told).to(self.scale.device)).cpu().numpy()
            return found

        return Expectation(predict, self.reading, REACH, self.ahead)

    def recording(self, utterance: Utterance, heard: list[Bands], emotions: tuple[str, ...]) -> Recording:
        """What one utterance teaches."""
        frames, present = utterance.motion.frames, complete(utterance.motion.frames)
        filled = np.where(present[:, None], frames, self.pca.mean.cpu().numpy())
        poses = self.pca.encode(torch.from_numpy(filled.astype(np.float32)).to(self.scale.device)) / self.scale
        said = Said.of(utterance.speech, emotions)
        own, *others = heard
        return Recording(own, tuple(others), said, poses.cpu().numpy(), present.astype(np.float32), utterance.motion.fps)


def _heard(hearing: Hearing, corpus: Corpus, voices: int, one: tuple[str, dict[str, Any]]) -> list[Bands]:
    """Features of a recording, and of changed sounds of it, drawn by a generator in the state that is given."""
    name, state = one
    speech = corpus[name].speech
    own = hearing.bands(speech)
    if not voices:
        return [own]
    rng, sound, others = np.random.default_rng(), resample(speech.audio, speech.sample_rate, VOICES_HZ), []
    rng.bit_generator.state = state
    for _ in range(voices):
        changed, speed = other_voice(sound, rng)
        bands = hearing.of_sound(changed)
        at = np.clip(np.arange(len(own)) / speed, 0, len(bands) - 1)
        others.append(linear_at(bands, at).astype(np.float16))
    return [own, *others]


def _no_components() -> Pca:
    return Pca(torch.zeros(0), torch.zeros(0, 0), torch.zeros(0))


def train(network: PoseNetwork, loss: PointLoss, windows: Windows, steps: int, seed: int) -> PoseNetwork:
    """AdamW on windows drawn by seed; what comes back has the averaged weights."""
    device, averaged = next(network.parameters()).device, deepcopy(network)

    def missed(rng: np.random.Generator) -> Tensor:
        batch = windows.draw(rng).to(device)
        found: Tensor = loss(*network(batch.told), batch)
        return found

    taken = trainer.train(network, missed, learning(network, steps), seed, "learning what is expected")
    for step, _ in enumerate(taken):
        average(averaged, network, step)
    return averaged.eval()


def learning(network: nn.Module, steps: int) -> Learning:
    """The optimiser, and how its rate goes."""
    optimiser = torch.optim.AdamW(network.parameters(), LEARNING_RATE, weight_decay=WEIGHT_DECAY)
    total = max(steps, 2)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, LEARNING_RATE, total_steps=total, pct_start=WARMING)
    return Learning(steps, optimiser, schedule, LARGEST_GRADIENT)


@torch.no_grad()
def average(averaged: nn.Module, network: nn.Module, step: int) -> None:
    """Draw averaged weights towards those after a step: an exponential mean, which at the start is a plain one."""
    share = 1 - min(AVERAGED, (step + 1) / (step + SETTLING))
    for mean, newest in zip(averaged.parameters(), network.parameters(), strict=True):
        mean.lerp_(newest, share)
