"""One fixed shape for each viseme class, cross-faded: what small lip-sync tools do."""

from typing import Any, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from facesynth.corpus import Corpus
from facesynth.inference.motion import Motion
from facesynth.inference.phones import SILENCE, VISEME_CLASSES, viseme_of
from facesynth.inference.speech import PhoneTrack, Speech
from facesynth.methods.baselines.capabilities import VISEME_TABLE
from facesynth.methods.learn.frames import PoseSum, mean_pose
from facesynth.methods.method import Method
from facesynth.methods.registry import register

FADE_S = 0.06
"""How long one shape takes to become the next, around the moment at which one phone ends and the next begins."""
MIDDLE = (1 / 3, 2 / 3)
"""The part of a phone from which its class's shape is taken."""


@register(VISEME_TABLE)
class VisemeTable(Method):
    """The mean shape at the middle of each viseme class, held while a phone of it lasts and cross-faded into the next.

    No emotion, no context, no duration: a table of 15 shapes. A class that was never recorded has the shape of silence.
    """

    shapes: Tensor
    """[15, C]"""

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer("shapes", torch.zeros(len(VISEME_CLASSES), 0))

    def fit(self, corpus: Corpus, *, seed: int = 0) -> Self:
        """Take the mean of the frames in the middle of the phones of each class; missing samples do not count."""
        self.learned_from(corpus)
        sums = [PoseSum(corpus.layout.channels) for _ in VISEME_CLASSES]
        for utterance in corpus:
            phones, frames = utterance.speech.phones, utterance.motion.frames
            for label, start_s, end_s in zip(phones.labels, phones.starts_s, phones.ends_s, strict=True):
                low, high = (start_s + part * (end_s - start_s) for part in MIDDLE)
                first = min(round(low * corpus.fps), len(frames) - 1)
                sums[viseme_of(label)].add(frames[first : max(first + 1, round(high * corpus.fps))])
        rest = sums[viseme_of(SILENCE)].mean(mean_pose(corpus))
        shapes = np.stack([total.mean(rest) for total in sums]).astype(np.float32)
        self.shapes = torch.from_numpy(shapes).to(self.device)
        return self.eval()

    def synthesize(self, speech: Speech, *, seed: int = 0, **options: Any) -> Motion:
        """Shapes of the phones' classes, cross-faded."""
        self.refuse(options)
        layout, count = self.fitted_layout, int(speech.phones.frame_bounds(self.fps)[-1])
        shown = cross_fades(speech.phones.told(self.name), np.arange(count) / self.fps)
        classes = np.array([viseme_of(label) for label in speech.phones.labels])
        frames = shown @ self.shapes.cpu().numpy().astype(np.float64)[classes]
        return Motion(frames.astype(np.float32), self.fps, layout)


def cross_fades(phones: PhoneTrack, times_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """[T, P] how much of each phone is shown at times [T]; rows sum to 1.

    A phone begins to appear FADE_S / 2 before it begins and has gone as long after its end; of two ends that lie nearer than
    that both fades overlap, and the phone between them is never shown whole.
    """
    ends = phones.ends_s[:-1]
    begun = np.clip((times_s[:, None] - ends) / FADE_S + 0.5, 0, 1)  # [T, P - 1] of each phone after the first
    return np.hstack([np.ones((len(times_s), 1)), begun]) - np.hstack([begun, np.zeros((len(times_s), 1))])
