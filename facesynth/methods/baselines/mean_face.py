"""The mean face: what an error means that knows nothing of the speech."""

from typing import Any, Self

import numpy as np
import torch
from torch import Tensor

from facesynth.corpus import Corpus
from facesynth.inference.motion import Motion
from facesynth.inference.speech import Speech
from facesynth.methods.baselines.capabilities import MEAN_FACE
from facesynth.methods.learn.frames import mean_pose
from facesynth.methods.method import Method
from facesynth.methods.registry import register


@register(MEAN_FACE)
class MeanFace(Method):
    """Every frame is the mean of all recorded frames; missing samples do not count."""

    mean: Tensor
    """[C]"""

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(0))

    def fit(self, corpus: Corpus, *, seed: int = 0) -> Self:
        """Take the mean of what was recorded."""
        self.learned_from(corpus)
        self.mean = torch.from_numpy(mean_pose(corpus).astype(np.float32)).to(self.device)
        return self.eval()

    def synthesize(self, speech: Speech, *, seed: int = 0, **options: Any) -> Motion:
        """The mean pose, for as long as the phones last."""
        self.refuse(options)
        layout = self.fitted_layout
        count = int(speech.phones.frame_bounds(self.fps)[-1])
        return Motion(np.tile(self.mean.cpu().numpy(), (count, 1)), self.fps, layout)
