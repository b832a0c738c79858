"""The phone mean: one static pose per phone, the visemes of the animator's table."""

from collections import defaultdict
from typing import Any, Self

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from torch import Tensor

from facesynth.corpus import Corpus
from facesynth.inference.motion import Motion
from facesynth.inference.speech import NEUTRAL, PhoneTrack, Speech
from facesynth.methods.baselines.capabilities import PHONE_MEAN
from facesynth.methods.learn.frames import PoseSum, mean_pose
from facesynth.methods.method import Method
from facesynth.methods.registry import register

ANY = ""
"""Stands for any emotion."""
HOLD_S = 0.15
"""The pose of a long phone, a pause above all, is reached this long after its start and left as long before its end, s."""


@register(PHONE_MEAN)
class PhoneMean(Method):
    """Each phone's mean pose, in each emotion in which it was recorded, joined smoothly from middle to middle.

    A phone that was never recorded in the asked emotion takes its pose from all emotions, one that was never
    recorded at all takes the mean face. An intensity under 1 is a blend with the neutral pose.
    """

    mean: Tensor
    """[C] the mean face."""
    poses: Tensor
    """[R, C] mean poses; row r belongs to the (emotion, phone) `facts["rows"][r]`, emotion "" for all together."""

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(0))
        self.register_buffer("poses", torch.zeros(0, 0))

    def fit(self, corpus: Corpus, *, seed: int = 0) -> Self:
        """Take the mean of all frames of each phone; missing samples do not count."""
        self.learned_from(corpus)
        mean = mean_pose(corpus)
        sums = _pose_sums(corpus)
        together = {phone: total.mean(mean) for (emotion, phone), total in sums.items() if emotion == ANY}
        rows = sorted(sums)
        poses = np.array([sums[row].mean(together[row[1]]) for row in rows], np.float32)
        self.mean, self.poses = (torch.from_numpy(a).to(self.device) for a in (mean.astype(np.float32), poses))
        self.facts = {"rows": [list(row) for row in rows]}
        return self.eval()

    def synthesize(self, speech: Speech, *, seed: int = 0, **options: Any) -> Motion:
        """Poses at the middles of the phones, and between them the cubic that never overshoots (PCHIP)."""
        self.refuse(options)
        layout = self.fitted_layout
        targets = self._targets(speech)
        knots_s, owners = _knots(speech.phones.told(self.name))
        times_s = np.arange(speech.phones.frame_bounds(self.fps)[-1]) / self.fps
        if len(knots_s) == 1:
            return Motion(np.tile(targets[0].astype(np.float32), (len(times_s), 1)), self.fps, layout)
        curve = PchipInterpolator(knots_s, targets[owners], axis=0)
        frames = curve(np.clip(times_s, knots_s[0], knots_s[-1]))
        return Motion(frames.astype(np.float32), self.fps, layout)

    def _targets(self, speech: Speech) -> NDArray[np.float64]:
        """[P, C] the pose of each phone in its emotion."""
        emotions, intensities = speech.emotions.per_phone(speech.phones)
        asked = np.array([self._pose(e, p) for e, p in zip(emotions, speech.phones.labels, strict=True)])
        neutral = np.array([self._pose(NEUTRAL, p) for p in speech.phones.labels])
        return neutral + intensities[:, None] * (asked - neutral)

    def _pose(self, emotion: str, phone: str) -> NDArray[np.float64]:
        rows = self.facts["rows"]
        for row in ([emotion, phone], [ANY, phone]):
            if row in rows:
                return self.poses[rows.index(row)].cpu().numpy().astype(np.float64)
        return self.mean.cpu().numpy().astype(np.float64)


def _pose_sums(corpus: Corpus) -> dict[tuple[str, str], PoseSum]:
    """Sums by (emotion, phone) and, emotion "", by phone alone."""
    sums: dict[tuple[str, str], PoseSum] = defaultdict(lambda: PoseSum(corpus.layout.channels))
    for utterance in corpus:
        phones = utterance.speech.phones
        bounds = phones.frame_bounds(corpus.fps)
        emotions, _ = utterance.speech.emotions.per_phone(phones)
        for i, (emotion, phone) in enumerate(zip(emotions, phones.labels, strict=True)):
            frames = utterance.motion.frames[bounds[i] : bounds[i + 1]]
            sums[emotion, phone].add(frames)
            sums[ANY, phone].add(frames)
    return sums


def _knots(phones: PhoneTrack) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Times at which a pose is reached (s), strictly increasing, and the phone that it belongs to.

    One in the middle of each phone; two, HOLD_S inside both ends, for a phone that is longer than both together.
    """
    starts, ends = phones.starts_s, phones.ends_s
    long = ends - starts > 2 * HOLD_S + 1e-6  # else both would lie in one place, give or take the rounding of times
    first = np.where(long, starts + HOLD_S, (starts + ends) / 2)
    index = np.arange(len(phones))
    times = np.concatenate([first, ends[long] - HOLD_S])
    order = np.argsort(times, kind="stable")
    return times[order], np.concatenate([index, index[long]])[order]
