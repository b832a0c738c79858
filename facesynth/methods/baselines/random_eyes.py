"""Eyes by chance: places and blinks at random times, as often and as wide as recorded. Learned eyes must be nearer."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Self

import numpy as np
import torch
from torch import Tensor

from facesynth.corpus import Corpus
from facesynth.corpus.eyes import recorded_eyes
from facesynth.inference.arrays import Floats
from facesynth.inference.errors import FacesynthError
from facesynth.inference.eyes import at_rest
from facesynth.inference.gaze import gaze_shifts
from facesynth.inference.motion import Motion
from facesynth.inference.speech import Speech
from facesynth.methods.baselines.capabilities import EYES_RANDOM
from facesynth.methods.method import Method
from facesynth.methods.registry import register
from facesynth.motion.gaps import runs
from facesynth.motion.lids import Lids, eyes_of

SHIFT_RAD = np.radians(2.0)
"""Smaller shifts of the gaze are not counted."""
SHUT, BLINK_S = 0.2, 0.2
"""Opening under which an eye is shut, and for how long."""
REACHED = 0.95
"""Quantile of how far the gaze goes that random places lie within."""


@register(EYES_RANDOM)
class RandomEyes(Method):
    """A gaze that jumps from place to place within the recorded reach, and blinks, both at random times at the recorded rates."""

    rates: Tensor
    """[2] shifts and blinks a second."""
    reach: Tensor
    """[2] how far the gaze goes to the sides and up or down, rad."""

    def __init__(self) -> None:
        super().__init__()
        for name in ("rates", "reach"):
            self.register_buffer(name, torch.zeros(0, dtype=torch.float64))

    def fit(self, corpus: Corpus, *, seed: int = 0) -> Self:
        """Count; FacesynthError where no recording has eyes."""
        self.learned_from(corpus, silent=True)
        device = self.device
        eyes = [motion for motion, _ in recorded_eyes(corpus)]
        if not eyes:
            raise FacesynthError(
                f"{corpus.path} has no recording with eyes (gaze and lids); capture them from video, or add them"
            )
        rates, reach = counted(eyes)
        self.rates, self.reach = (torch.from_numpy(array).to(device) for array in (rates, reach))
        return self.eval()

    def synthesize(self, speech: Speech, *, seed: int = 0, **options: Any) -> Motion:
        """A still face with such eyes."""
        self.refuse(options)
        still = at_rest(self.fitted_layout, int(speech.phones.frame_bounds(self.fps)[-1]), self.fps)
        shifts, blinks = self.rates.tolist()
        eyes = random_eyes(len(still), self.fps, 1 / max(shifts, 1e-3), self.reach.cpu().numpy(), 60 * blinks, seed)
        return replace(still, eyes=eyes.astype(np.float32))


def counted(motions: Sequence[Motion]) -> tuple[Floats, Floats]:
    """Shifts and blinks a second [2], and the reach of the gaze [2], rad, of motions with eyes.

    FacesynthError where there are none.
    """
    if not motions:
        raise FacesynthError("no recording has eyes (gaze and lids); capture them from video, or add them")
    lids, seconds, shifts, blinks, away = Lids.of(motions), 0.0, 0, 0, list[Floats]()
    for motion in motions:
        known = np.isfinite(eyes_of(motion)).all(axis=1)
        gaze, opening = eyes_of(motion)[known, 1:].astype(np.float64), lids.opening(motion)[known, 0]
        seconds += len(gaze) / motion.fps
        shifts += sum(np.hypot(*one.step) > SHIFT_RAD for one in gaze_shifts(gaze, motion.fps)) if len(gaze) else 0
        blinks += sum(one.start > 0 for one in runs(opening < SHUT))
        away.append(np.abs(gaze - np.median(gaze, axis=0)) if len(gaze) else gaze)
    return np.array([shifts, blinks]) / max(seconds, 1e-9), np.quantile(np.concatenate(away), REACHED, axis=0)


def random_eyes(count: int, fps: float, shifts_s: float, reach: Floats, blinks: float, seed: int) -> Floats:
    """[T, 3] lids and gaze: places drawn evenly within reach (rad), one in shifts_s seconds on average; blinks a minute."""
    rng = np.random.default_rng(seed)
    changes = np.cumsum(rng.random(count) < 1 / (shifts_s * fps))
    gaze = rng.uniform(-1, 1, (int(changes.max(initial=0)) + 1, 2))[changes] * reach
    shut = np.convolve(rng.random(count) < blinks / 60 / fps, np.ones(max(1, round(BLINK_S * fps))))[:count] > 0
    return np.column_stack([1.0 - shut, gaze])
