"""What the regressions hear: standardised log-mel bands, or hidden layers of the phone network, around a time."""

from collections.abc import Iterable
from typing import Any, Literal

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from facesynth.corpus import Corpus
from facesynth.inference.errors import unknown
from facesynth.inference.expectation import Standard
from facesynth.inference.heard import Listening, hidden_layer
from facesynth.inference.sound import resample
from facesynth.inference.speech import Speech
from facesynth.speech.mel import LogMel
from facesynth.speech.phone_network import phone_network
from facesynth.speech.phone_weights import WIDTH

Features = Literal["log_mel", "phone_net", "both"]
BANDS = 40
"""Log-mel bands, unless told otherwise."""
HIDDEN_LAYER = 1
"""The second block's output: of the four, and of pairs of them, a network that learned from it follows strangers' lips best and
the talker's own no worse than from the third, which a regression tells visemes from best."""
EARLIER_LAYER = 2
"""What models heard with whose files do not say the layer."""
WIDTHS = {"log_mel": BANDS, "phone_net": WIDTH, "both": BANDS + WIDTH}


class Hearing(nn.Module):
    """Features of a speech at any times, each with mean 0 and deviation 1 over the training speech.

    features: log-mel bands, 40 unless told otherwise, or what the phone network makes of the sound (`phone_net`), which
    depends less on who speaks, or both. FacesynthError for any other.
    """

    mean: Tensor
    """[W]"""
    deviation: Tensor
    """[W]"""
    layer: Tensor
    """[1] of the phone network, from 0, where that is heard."""

    def __init__(self, features: Features = "log_mel", bands: int = BANDS) -> None:
        super().__init__()
        if features not in WIDTHS:
            raise unknown("features", features, WIDTHS)
        self.features = features
        self.width = WIDTHS[features] + (0 if features == "phone_net" else bands - BANDS)
        self.mel = LogMel(bands=bands)
        self.register_buffer("mean", torch.zeros(self.width))
        self.register_buffer("deviation", torch.ones(self.width))
        if features != "log_mel":
            self.register_buffer("layer", torch.tensor([EARLIER_LAYER]))

    def begin(self) -> None:
        """Hear from now on as models that are learned today do."""
        if self.features != "log_mel":
            self.layer = torch.full_like(self.layer, HIDDEN_LAYER)

    def learn(self, corpus: Corpus) -> None:
        """Take mean and deviation of each feature from all sounds of a corpus."""
        self.begin()
        self.standardise(self.bands(utterance.speech) for utterance in corpus)

    def standardise(self, heard: Iterable[NDArray[Any]]) -> None:
        """The same from features [F, W] of any sounds."""
        count, total, squares = 0, np.zeros(self.width), np.zeros(self.width)
        for each in heard:
            bands = each.astype(np.float64)
            count, total, squares = count + len(bands), total + bands.sum(axis=0), squares + np.square(bands).sum(axis=0)
        mean = torch.from_numpy(total / count)
        self.mean = mean.float().to(self.mean.device)
        self.deviation = (torch.from_numpy(squares / count) - mean.square()).clamp(min=1e-4).sqrt().float().to(self.mean.device)

    def at(self, speech: Speech, times_s: NDArray[np.float64]) -> Tensor:
        """Standardised features [..., W] at times [...] (s); times outside the sound get its first or last frame."""
        return torch.from_numpy(self.standard().at(self.bands(speech), times_s)).to(self.mean.device)

    def standard(self) -> Standard:
        """Mean and deviation as arrays."""
        return Standard(self.mean.cpu().numpy(), self.deviation.cpu().numpy())

    def bands(self, speech: Speech) -> NDArray[np.float32]:
        """[F, W] of a speech, not standardised, a frame every 10 ms."""
        return self.of_sound(np.ascontiguousarray(resample(speech.audio, speech.sample_rate, self.mel.sample_rate)))

    def of_sound(self, audio: NDArray[np.float32]) -> NDArray[np.float32]:
        """The same of sound [S] at 16 kHz."""
        if self.features == "phone_net":
            return self._hidden(audio)
        heard = self._bands(audio)
        return heard if self.features == "log_mel" else np.hstack([heard, self._hidden(audio)])

    def listening(self) -> Listening:
        """What a model speaks by: the same of whole sounds, and of sound in pieces."""
        bands = None if self.features == "phone_net" else self._bands
        network = None if self.features == "log_mel" else phone_network().part
        return Listening(bands, network, int(self.layer) if network else 0)

    @torch.no_grad()
    def _bands(self, audio: NDArray[np.float32]) -> NDArray[np.float32]:
        found: NDArray[np.float32] = self.mel(torch.from_numpy(audio).to(self.mel.window.device)).cpu().numpy()
        return found

    def _hidden(self, audio: NDArray[np.float32]) -> NDArray[np.float32]:
        return hidden_layer(phone_network().part, audio, int(self.layer))
