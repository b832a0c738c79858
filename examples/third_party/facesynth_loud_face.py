"""A method for facesynth in one file: the face follows the loudness of the voice.

Installed beside facesynth (`pip install ./examples/third_party`), it is known to every verb:

    facesynth train loud_face my_actor
    facesynth speak loud_face.safetensors speech.wav --liveliness 1.5 -o out.mp4
    facesynth evaluate my_actor loud_face -o report/

A package whose entry should be read without importing torch keeps CAPABILITIES in a module of its own.
"""

from typing import Any, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from facesynth.corpus import Corpus
from facesynth.inference.errors import FacesynthError
from facesynth.inference.motion import Motion
from facesynth.inference.speech import Speech
from facesynth.methods.capabilities import Capabilities, Option
from facesynth.methods.method import Method
from facesynth.methods.registry import register

CAPABILITIES = Capabilities(
    "loud_face",
    "every channel follows the loudness of the voice",
    home="facesynth_loud_face",
    options=(Option("liveliness", float, "Factor on the movement about the mean face; 1 as learned.", least=0, most=5),),
    minutes=0.2,
)
SILENT = 1e-4
"""What is added to the sound's root mean square, so that silence has a loudness: -80 dB."""


@register(CAPABILITIES)
class LoudFace(Method):
    """Linear regression of each channel on the loudness (dB) of the sound around a frame.

    `window_s` is the length of that sound, s.
    """

    line: Tensor
    """[2, C] each channel at the mean loudness, and its change for a dB more."""
    mean_db: Tensor
    """[1] mean loudness of the recordings."""

    def __init__(self, window_s: float = 0.1) -> None:
        super().__init__()
        self.register_buffer("line", torch.zeros(2, 0))
        self.register_buffer("mean_db", torch.zeros(1))

    def fit(self, corpus: Corpus, *, seed: int = 0) -> Self:
        """Least squares over all complete frames; nothing is drawn, so `seed` changes nothing."""
        self.learned_from(corpus)
        moved = np.concatenate([utterance.motion.frames for utterance in corpus]).astype(np.float64)
        heard = np.concatenate([self.loudness_db(utterance.speech, len(utterance.motion)) for utterance in corpus])
        whole = np.isfinite(moved).all(axis=1)
        if whole.sum() < 2:
            raise FacesynthError(f"{corpus.path} has {whole.sum()} frames without gaps; at least 2 are needed")
        moved, heard = moved[whole], heard[whole]
        louder = heard - heard.mean()
        slope = louder @ (moved - moved.mean(axis=0)) / max(float(louder @ louder), 1e-12)
        self.line = torch.from_numpy(np.stack([moved.mean(axis=0), slope])).float().to(self.device)
        self.mean_db = torch.tensor([heard.mean()]).float().to(self.device)
        return self.eval()

    def synthesize(self, speech: Speech, *, seed: int = 0, liveliness: float = 1.0, **options: Any) -> Motion:
        """Motion as long as the phones; `liveliness` scales the movement about the mean face."""
        self.refuse(options)
        layout, count = self.fitted_layout, int(speech.phones.frame_bounds(self.fps)[-1])
        mean, slope = self.line.cpu().numpy()
        louder = self.loudness_db(speech, count) - float(self.mean_db)
        return Motion((mean + liveliness * louder[:, None] * slope).astype(np.float32), self.fps, layout)

    def loudness_db(self, speech: Speech, count: int) -> NDArray[np.float64]:
        """[count] loudness around each frame."""
        half = max(1, round(self.config["window_s"] * speech.sample_rate / 2))
        power = np.concatenate([[0.0], np.cumsum(np.square(speech.audio, dtype=np.float64))])
        middle = np.round((np.arange(count) + 0.5) / self.fps * speech.sample_rate).astype(np.int64)
        first, last = np.clip(middle - half, 0, len(power) - 2), np.clip(middle + half, 1, len(power) - 1)
        return 20 * np.log10(np.sqrt((power[last] - power[first]) / (last - first)) + SILENT)
