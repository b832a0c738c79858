"""A head by constants: slow sway, and small nods where the voice is loud. Learned heads must be more like people than this."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from facesynth.inference.arrays import Floats
from facesynth.inference.motion import Motion
from facesynth.inference.speech import Speech
from facesynth.methods.baselines.capabilities import HEAD_SWAY
from facesynth.methods.baselines.heads import HeadRest
from facesynth.methods.registry import register

SWAY_DEGREES = (0.9, 1.4, 0.8)
"""Standard deviation of pitch, yaw and roll."""
SWAY_S = 0.6
"""Width of the smoothing that makes the sway slow."""
NOD_DEGREES = 2.2
"""How far the head goes down at full loudness."""
LEVEL_S = 0.03
"""Over how long the level of the sound is taken."""


@register(HEAD_SWAY)
class HeadSway(HeadRest):
    """The mean of all recorded poses, swaying by constants."""

    def synthesize(self, speech: Speech, *, seed: int = 0, **options: Any) -> Motion:
        """A head that sways about the mean pose, for as long as the phones last."""
        rest = super().synthesize(speech, seed=seed, **options)
        sway = quiet_head(len(rest), self.fps, loudness(speech, len(rest), self.fps), seed)
        return replace(rest, head=self.pose.cpu().numpy() + sway)


def quiet_head(count: int, fps: float, loudness: Floats, seed: int) -> NDArray[np.float32]:
    """[T, 6] pose of a head that sways; loudness [T] in 0..1 makes the nods."""
    rng = np.random.default_rng(seed)
    margin = int(4 * SWAY_S * fps) + 1
    noise = gaussian_filter1d(rng.normal(size=(count + 2 * margin, 3)), SWAY_S * fps, axis=0)
    noise = noise[margin : margin + count] / max(noise.std(), 1e-9)
    turn = np.radians(SWAY_DEGREES) * noise
    nod = gaussian_filter1d(loudness - loudness.mean(), 0.09 * fps, mode="nearest") if count else loudness
    turn[:, 0] += np.radians(NOD_DEGREES) * nod
    return np.hstack([turn, np.zeros((count, 3))]).astype(np.float32)


def loudness(speech: Speech, count: int, fps: float) -> Floats:
    """[T] root mean square of the sound around each frame, over its loudest tenth, at most 1."""
    window = max(int(LEVEL_S * speech.sample_rate), 1)
    power = np.convolve(speech.audio.astype(np.float64) ** 2, np.ones(window) / window, mode="same")
    at = np.minimum((np.arange(count) / fps * speech.sample_rate).astype(np.int64), len(power) - 1)
    level = np.sqrt(power[at])
    return np.asarray(np.minimum(level / max(float(np.percentile(level, 90)), 1e-9), 1.0) if count else level)
