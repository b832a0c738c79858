"""The first RASTA-PLP parameters of each phone: what a node sounded like."""

import numpy as np
import torch
from numpy.typing import NDArray

from facesynth.inference.anime_graph.hearing import RATE
from facesynth.inference.sound import resample
from facesynth.inference.speech import Speech
from facesynth.speech.rasta_plp import RastaPlp


class AudioFeatures:
    """The first `parameters` RASTA-PLP cepstra at 100 Hz (Cao 2005 takes nine)."""

    def __init__(self, parameters: int) -> None:
        self.plp = RastaPlp(RATE, order=parameters - 1)
        self.fps = self.plp.fps

    def of(self, speech: Speech) -> NDArray[np.float64]:
        """[G, P] features of a whole sound."""
        audio = resample(speech.audio, speech.sample_rate, RATE)
        with torch.no_grad():
            return self.plp(torch.from_numpy(np.ascontiguousarray(audio))).numpy().astype(np.float64)
