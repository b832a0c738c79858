"""The network of poses as a method: what one would train today in place of a search."""

from typing import Any, Self

import numpy as np
from torch import nn

from facesynth.corpus import Corpus
from facesynth.inference.errors import FacesynthError
from facesynth.inference.lips import bilabial_spans, gap, narrowest_gaps
from facesynth.inference.motion import Motion
from facesynth.inference.network import AHEAD_S, SoundStream
from facesynth.inference.network import Network as Speaker
from facesynth.inference.openings import Openings
from facesynth.inference.speech import Speech
from facesynth.methods.learn.expectation import STEPS, PosePredictor
from facesynth.methods.learn.hearing import Features
from facesynth.methods.learn.residual import Residual
from facesynth.methods.method import Method
from facesynth.methods.network.capabilities import CAPABILITIES
from facesynth.methods.registry import register

WIDE_PERCENTILE = 95
"""Of recorded openings: what counts as wide open."""


@register(CAPABILITIES)
class Network(Method):
    """A residual network of dilated convolutions from sound, phones and emotion to 30 components of the motion.

    Parameters
    ----------
    steps : int
        Of the training.
    phones : bool
        Whether the network is told what is said. Without, sound alone is enough, and is what streams as it comes in.
    look_ahead_s : float
        How much of the sound after a frame the network may hear, seconds; 0 or more. At most as much as it hears before
        (0.7 s at 25 frames a second), which is also what a negative one stands for.
    features : str
        What is heard: `log_mel`, `phone_net` or `both`.
    voices : int
        How many changed sounds of each recording are learned from as well: other vocal tracts, microphones, rooms, levels.
    unsaid : float
        The share of what is learned from in which the network is not told what is said, and must hear it; 0..1.
    sharpening : float
        How much quick movement is raised: the pose in the middle of the likely ones moves too little.
    close_lips : bool
        Whether lips come as near to each other at p, b and m as they were recorded to.
    residual : float
        How much is added of what recorded faces do beside their lips (see `inference.residual`); 1 as recorded.
    opening_power : float
        Exponent of how far lips are open between shut (0) and wide open (1); above 0. Below 1 small openings become wider, for
        mouths that open more evenly than the talker's (see `inference.openings`).
    """

    def __init__(
        self,
        steps: int = STEPS,
        phones: bool = True,
        look_ahead_s: float = -1.0,
        features: Features = "both",
        voices: int = 0,
        unsaid: float = 0.0,
        sharpening: float = 0.0,
        close_lips: bool = False,
        residual: float = 0.0,
        opening_power: float = 1.0,
    ) -> None:
        super().__init__()
        if (
            steps < 1
            or not 0 <= min(sharpening, residual) <= max(sharpening, residual) < float("inf")
            or not look_ahead_s < float("inf")
        ):
            raise FacesynthError(
                "network needs at least one step of training, sharpening and residual of 0 or more and a finite look-ahead; "
                f"got {steps}, {sharpening}, {residual} and {look_ahead_s}"
            )
        if not 0 < opening_power < float("inf"):
            raise FacesynthError(f"opening_power is {opening_power}; wanted a number above 0, 1 to leave openings as they are")
        if voices < 0 or not 0 <= unsaid <= 1:
            raise FacesynthError(f"network needs 0 voices or more and a share unsaid of 0 to 1; got {voices} and {unsaid}")
        ahead = None if look_ahead_s < 0 else look_ahead_s
        self.predictor = PosePredictor(features, phones=phones, look_ahead_s=ahead, voices=voices, unsaid=unsaid)
        self.residual = Residual() if residual > 0 else None

    @property
    def needs_phones(self) -> bool:
        """Unless sound alone was what it learned from."""
        return bool(self.config["phones"])

    def fit(self, corpus: Corpus, *, seed: int = 0) -> Self:
        """Learn from the complete frames of a corpus."""
        self.learned_from(corpus)
        self.predictor.learn(corpus, nn.Identity(), seed, self.config["steps"])
        if self.residual is not None:
            self.facts["no_residual"] = self.residual.learn(corpus)
        gaps = [
            narrowest
            for utterance in corpus
            for narrowest in narrowest_gaps(
                utterance.motion.frames, corpus.layout, bilabial_spans(utterance.speech.phones, corpus.fps)
            )
        ]
        self.facts["closed_gap"] = float(np.median(gaps)) if gaps else None
        self.facts["wide_gap"] = _wide_gap(corpus) if gaps else None
        return self.to(self.device).eval()

    def speaker(self) -> Speaker:
        """What speaks, as an exported folder does."""
        closed = self.facts.get("closed_gap") if self.config["close_lips"] else None
        return Speaker(
            self.fitted_layout,
            self.fps,
            self.emotions,
            self.predictor.hearing.listening(),
            self.predictor.expectation(),
            sharpening=self.config["sharpening"],
            closed_gap=np.inf if closed is None else closed,
            openings=self.openings,
            residual=self.residual.motion(self.fps, self.config["residual"]) if self.residual else None,
            unsaid=self.config["unsaid"] > 0,
        )

    def synthesize(self, speech: Speech, *, seed: int = 0, **options: Any) -> Motion:
        """Motion for new speech; nothing is random."""
        self.refuse(options)
        return self.speaker().synthesize(speech)

    def stream(self, *, emotion: str | None = None, sample_rate: int | None = None, ahead_s: float = AHEAD_S) -> SoundStream:
        """Sound in pieces, frames as soon as they are final; see `inference.network`."""
        return self.speaker().stream(emotion=emotion, sample_rate=sample_rate, ahead_s=ahead_s)

    @property
    def openings(self) -> Openings | None:
        """How openings are evened out; None where they are left, or where the layout has no lips."""
        shut, wide = self.facts.get("closed_gap"), self.facts.get("wide_gap")
        if self.config["opening_power"] == 1 or shut is None or wide is None:
            return None
        return Openings(self.config["opening_power"], shut, wide)


def _wide_gap(corpus: Corpus) -> float:
    """The opening of the lips that one frame in twenty exceeds."""
    gaps = np.concatenate([gap(utterance.motion.frames, corpus.layout) for utterance in corpus])
    return float(np.nanpercentile(gaps, WIDE_PERCENTILE))
