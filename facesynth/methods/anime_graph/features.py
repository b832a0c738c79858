"""The first RASTA-PLP parameters of each phone: what a node sounded like."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from facesynth.inference.errors import FacesynthError
from facesynth.inference.sound import resample
from facesynth.inference.speech import PhoneTrack, Speech
from facesynth.speech.rasta_plp import RastaPlp

RATE = 16000
SMALLEST_SWING = 1e-4
"""A sound whose samples differ by less (full scale is 2) is constant: there is nothing in it to match."""


class AudioFeatures:
    """The first `parameters` RASTA-PLP cepstra at 100 Hz (Cao 2005 takes nine)."""

    def __init__(self, parameters: int) -> None:
        self.plp = RastaPlp(RATE, order=parameters - 1)
        self.fps = self.plp.fps

    def of(self, speech: Speech, of_what: str = "the speech") -> NDArray[np.float64]:
        """[G, P] features; FacesynthError where the sound is constant or shorter than its phones."""
        if float(np.ptp(speech.audio)) < SMALLEST_SWING:
            raise FacesynthError(f"the sound of {of_what} is constant (silence?); choose a recording in which somebody speaks")
        audio = resample(speech.audio, speech.sample_rate, RATE)
        with torch.no_grad():
            return self.plp(torch.from_numpy(np.ascontiguousarray(audio))).numpy().astype(np.float64)


def ranges(phones: PhoneTrack, fps: float, count: int) -> NDArray[np.int64]:
    """[P, 2] first feature frame and one past the last of each phone, at least one each, within `count` frames."""
    bounds = phones.frame_bounds(fps)
    starts = np.minimum(bounds[:-1], count - 1)
    return np.stack([starts, np.maximum(np.minimum(bounds[1:], count), starts + 1)], axis=1)
